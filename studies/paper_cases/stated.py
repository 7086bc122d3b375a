"""Numbers the paper prints: table 1 and the cost of the true unknowns beside wrong knowns."""

# Table 1 of the paper: V at the start, V at the end, largest error [m], words on the coefficients
PAPER = {
    "1": (3.3e8, 2.0e-2, 2e-3, 'many improve, N "particularly poorly"'),
    "2": (1.1e8, 1.0e-3, 1e-3, "good; one stray in X, one in Y"),
    "3": (1.3e8, 2.3e2, 0.5, "very poor, five on the 25 % bounds"),
}
PAPER_KNOWN_WRONG = 1.3e5
