"""What is seen of a log's pixels: sums over a sample of its frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.classes import Labels
from stsem.frame import Depth, Image
from stsem.log.log import Log

SAMPLED_FRAMES = 50
DEPTH_BINS = 1_000_000
"""Of a millimetre; the last one holds everything farther off. Depth of 16 bits in a wrong unit is below a centimetre,
floats in millimetres are above a kilometre: both are to be told apart."""
DARK = 10.0
"""Mean of 0..255 below which an image is dark: a covered lens has 0 to 5, a room at night with a lamp 15 and more."""
FLAT = 3.0
"""Standard deviation of 0..255 below which an image is of one colour: noise alone has 1 to 2, fog about 10."""
STRIDE = 4
"""Every fourth pixel tells how bright an image is."""
Counts = npt.NDArray[np.int64]


@dataclass
class Seen:
    """Sums over the frames that were looked at.

    Args:
        class_pixels: (256,) pixels of each label.
        depth_mm: (DEPTH_BINS,) pixels of each depth in millimetres.
        frames, undecodable: looked at, and how many of them could not be decoded.
        dark, flat: colour images with next to no light, or of one colour only.
        truth_frames, depth_frames: frames with truth, with depth.
        unknown_depth: pixels.
    """

    class_pixels: Counts
    depth_mm: Counts
    frames: int = 0
    undecodable: int = 0
    dark: int = 0
    flat: int = 0
    truth_frames: int = 0
    depth_frames: int = 0
    unknown_depth: int = 0


def look(log: Log, *, full: bool) -> Seen:
    """Look at SAMPLED_FRAMES frames at most, evenly spread, or at all of them if `full`."""
    indices = range(len(log.plans)) if full else _spread(len(log.plans), SAMPLED_FRAMES)
    seen = Seen(class_pixels=np.zeros(256, np.int64), depth_mm=np.zeros(DEPTH_BINS, np.int64))
    for loaded in log.frames(indices, depth=True, previous=False, truth=True):
        seen.frames += 1
        seen.undecodable += loaded.error is not None
        if loaded.truth is not None:
            _add_truth(seen, loaded.truth)
        if loaded.frame is not None:
            _add_image(seen, loaded.frame.image)
            if loaded.frame.depth is not None:
                _add_depth(seen, loaded.frame.depth)
    return seen


def _add_image(seen: Seen, image: Image) -> None:
    pixels = image[::STRIDE, ::STRIDE].reshape(-1, 3).astype(np.float64)
    dark = float(pixels.mean()) < DARK
    seen.dark += dark
    seen.flat += not dark and float(pixels.std(axis=0).max()) < FLAT


def _add_truth(seen: Seen, truth: Labels) -> None:
    seen.truth_frames += 1
    seen.class_pixels += np.bincount(truth.ravel(), minlength=256)


def _add_depth(seen: Seen, depth: Depth) -> None:
    seen.depth_frames += 1
    known = depth[np.isfinite(depth)]
    seen.unknown_depth += depth.size - known.size
    millimetres = np.rint(np.minimum(known, DEPTH_BINS / 1000) * 1000).astype(np.int64)
    found = np.bincount(np.minimum(millimetres, DEPTH_BINS - 1))
    seen.depth_mm[: len(found)] += found


def _spread(n: int, most: int) -> Sequence[int]:
    """At most `most` of range(n), evenly spread, both ends among them."""
    if n <= most:
        return range(n)
    return [i * (n - 1) // (most - 1) for i in range(most)]
