"""Searches over replays: the highest rate that the pipeline sustains."""
