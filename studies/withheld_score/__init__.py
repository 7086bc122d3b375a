"""Study: Were the committed verdicts on withheld bundles right? Scored as they stand, every miss
explained."""
