"""Study: committed campaigns of the plant, diagnosed blind, scored, compared."""
