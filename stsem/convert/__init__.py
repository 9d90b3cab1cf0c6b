"""Data sets and foreign recordings to MCAP: one small file and one table row each."""
