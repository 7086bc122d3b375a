"""Study: do the intervals of a fit hold the truth where noise remembers, or the equations are wrong?"""
