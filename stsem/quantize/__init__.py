"""A network in int8, made on frames of logs. Needs `onnx`; a replay never comes here."""
