"""Verdicts over documents: rules, baselines, and what two reports must share to be compared."""
