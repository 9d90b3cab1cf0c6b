"""The steps of the paper's pipeline, one file each: register, select, segment | propagate, and fuse beside them."""
