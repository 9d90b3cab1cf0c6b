"""From camera images to a network's inputs and back; training uses the same functions."""

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import Labels
from stsem.frame import Image
from stsem.inference.sidecar import Difference, Sidecar

Tensor = npt.NDArray[np.float32]


def stretched(image: Image, size: tuple[int, int]) -> Image:
    """`image` (H, W, 3) uint8 RGB at the network's size (width, height), bilinear, aspect not kept."""
    if (image.shape[1], image.shape[0]) == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.uint8)


def image_input(image: Image, sidecar: Sidecar) -> Tensor:
    """(3, h, w) float32: (image / 255 - mean) / std of an RGB image already at the network's size."""
    levels = np.arange(256, dtype=np.float64) / 255.0
    planes = [((levels - mean) / std).astype(np.float32)[image[..., channel]]
              for channel, (mean, std) in enumerate(zip(sidecar.mean, sidecar.std, strict=True))]  # fmt: skip
    return np.stack(planes)


def difference_input(image: Image, previous: Image | None, difference: Difference) -> Tensor:
    """(3, h, w) float32: scale (image - previous) / 255, both RGB at the network's size; zero without a previous."""
    if previous is None:
        return np.zeros((3, *image.shape[:2]), np.float32)
    delta = image.astype(np.int16) - previous
    return np.ascontiguousarray(delta.transpose(2, 0, 1), np.float32) * np.float32(difference.scale / 255.0)


def network_inputs(image: Image, previous: Image | None, sidecar: Sidecar) -> dict[str, Tensor]:
    """Inputs by name, each (1, 3, h, w) float32, for one camera image (H, W, 3) uint8 RGB and its predecessor.

    A predecessor of another size than `image` is stretched likewise.
    """
    now = stretched(image, sidecar.size)
    inputs = {"image": image_input(now, sidecar)[None]}
    if sidecar.difference:
        before = None if previous is None else stretched(previous, sidecar.size)
        inputs["difference"] = difference_input(now, before, sidecar.difference)[None]
    return inputs


def labels_at(labels: Labels, size: tuple[int, int]) -> Labels:
    """`labels` (h, w) uint8 at `size` (width, height) by nearest neighbour, pixel centres aligned."""
    if (labels.shape[1], labels.shape[0]) == size:
        return labels
    return np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)
