"""The steps of the pipeline, one file each: register, select, segment | propagate; track and fuse beside them."""
