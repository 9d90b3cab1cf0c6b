"""The simulated clock: events, cores, costs and their trace. Knows no image, no log file and no network."""
