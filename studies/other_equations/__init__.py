"""Diagnoses of vehicles whose equations are not bayesid's, and how right they are."""
