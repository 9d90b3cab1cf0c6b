"""Recorded logs: reading, damage, decoding, choice of channels, frames, truth; and writing."""
