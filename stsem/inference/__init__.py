"""Running a network: its file and sidecar, preprocessing shared with training, sessions, the cache of outputs."""
