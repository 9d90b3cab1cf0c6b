"""The labelled scene in world coordinates, and its files."""
