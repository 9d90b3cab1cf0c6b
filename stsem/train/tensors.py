"""Views -> tensors, formed by the functions that inference uses."""

from collections.abc import Sequence

import numpy as np
import torch

from stsem.errors import TrainingError
from stsem.inference.preprocess import depth_input, difference_input, image_input
from stsem.inference.sidecar import Sidecar
from stsem.train.augment import View


def tensors(
    views: Sequence[View], sidecar: Sidecar, names: Sequence[str], device: str = "cpu"
) -> tuple[list[torch.Tensor], torch.Tensor]:
    """Inputs (B, channels, H, W) float32 in the order of `names`, and labels (B, H, W) int64.

    Raises:
        TrainingError: an input cannot be formed from these views and this sidecar.
    """
    inputs = [np.stack([_input(name, view, sidecar) for view in views]) for name in names]
    labels = np.stack([view.labels for view in views]).astype(np.int64)
    return (
        [torch.from_numpy(x).to(device=device, memory_format=torch.channels_last) for x in inputs],
        torch.from_numpy(labels).to(device),
    )


def _input(name: str, view: View, sidecar: Sidecar) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    if name == "image":
        return image_input(view.current, sidecar)
    if name == "difference" and sidecar.difference:
        return difference_input(view.current, view.previous, sidecar.difference)
    if name == "depth" and sidecar.depth and view.depth is not None:
        return depth_input(view.depth, sidecar.depth, (view.current.shape[1], view.current.shape[0]))
    raise TrainingError(f"The network takes {name!r}, which these pairs and this sidecar do not give; "
                        "choose another architecture, or data that has it.")  # fmt: skip
