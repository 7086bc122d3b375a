"""Study: the three cases of Furlong et al. (2003)."""
