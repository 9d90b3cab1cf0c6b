"""Methods that label a frame from keyframes, a file each; `stsem.stages.propagate` has the table."""
