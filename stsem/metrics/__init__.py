"""Every number of the report: a pure function and an accumulator each; definitions in docs/metrics.md."""
