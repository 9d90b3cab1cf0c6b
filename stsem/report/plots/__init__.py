"""The pictures of a report, one file each; deterministic bytes, colour-blind safe colours, readable in print."""
