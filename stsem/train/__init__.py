"""Training a network from scratch. Needs the extra `train`."""
