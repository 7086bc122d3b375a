"""Study: do credible intervals hold the truth as often as they say?"""
