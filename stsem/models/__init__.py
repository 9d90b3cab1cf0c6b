"""Networks in torch, one file per figure of its paper, and their export to ONNX. Needs the extra `train`."""
