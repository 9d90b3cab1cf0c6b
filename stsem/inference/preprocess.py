"""From camera images to a network's inputs and back; training uses the same functions."""

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import Labels
from stsem.frame import Depth, Image
from stsem.inference.sidecar import DepthForm, Difference, Sidecar

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


def depth_input(depth: Depth | None, form: DepthForm, size: tuple[int, int]) -> Tensor:
    """(1, h, w) float32 at `size` (width, height): scaled metres, and the form's stand-in where depth is unknown.

    Args:
        depth: (H, W) float32 metres, NaN unknown, of any size; None where the frame has none: unknown all over.
        form: of the sidecar.
        size: of the network's input.
    """
    if depth is None:
        return np.full((1, size[1], size[0]), form.unknown, np.float32)
    nearest = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
    scaled = nearest * np.float32(form.scale)
    return np.where(np.isfinite(nearest), scaled, np.float32(form.unknown))[None]


def network_inputs(
    image: Image, previous: Image | None, sidecar: Sidecar, depth: Depth | None = None
) -> dict[str, Tensor]:
    """Inputs by name, each (1, channels, h, w) float32, for one frame.

    Args:
        image: (H, W, 3) uint8 RGB.
        previous: its predecessor in the log, stretched likewise whatever its size; None for the first frame.
        sidecar: of the network; what it has no section for is not looked at.
        depth: as for `depth_input`.
    """
    now = stretched(image, sidecar.size)
    inputs = {"image": image_input(now, sidecar)[None]}
    if sidecar.difference:
        before = None if previous is None else stretched(previous, sidecar.size)
        inputs["difference"] = difference_input(now, before, sidecar.difference)[None]
    if sidecar.depth:
        inputs["depth"] = depth_input(depth, sidecar.depth, sidecar.size)[None]
    return inputs


def labels_at(labels: Labels, size: tuple[int, int]) -> Labels:
    """`labels` (h, w) uint8 at `size` (width, height) by nearest neighbour, pixel centres aligned."""
    if (labels.shape[1], labels.shape[0]) == size:
        return labels
    return np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)
