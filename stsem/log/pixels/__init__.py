"""Pixels: image messages to arrays. Raw images by a table of encodings, files by what their bytes begin with."""
