"""stsem: how accurate, how late and how fast a semantic scene-mapping pipeline is on a recorded log."""

__version__ = "0.1.0"
