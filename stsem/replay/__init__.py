"""One log through the pipeline: configuration, modes, the simulated and the offline run."""
