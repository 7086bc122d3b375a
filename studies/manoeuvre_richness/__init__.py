"""Study: which manoeuvre tells what, which to order next, and does the advice hold?"""
