"""stsem: how accurate, how late and how fast a semantic scene-mapping pipeline is on a recorded log."""

import os

__version__ = "0.1.0"

# ONNX Runtime's wheels keep a device id and a database of events in the user's home, and send them, from the moment of
# import. A replay needs no network and writes nothing outside of its folders; who wants it sets the variable to 0.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
