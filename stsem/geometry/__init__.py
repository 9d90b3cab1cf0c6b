"""Views of one scene against each other: features, homographies, warps. Functions on numpy arrays."""
