"""Rendered logs: an office floor, a camera that walks through it, and the sensors it carries."""
