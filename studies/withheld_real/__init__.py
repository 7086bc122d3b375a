"""Study: predictions and verdicts on real logs whose answer is kept elsewhere."""
