"""How raw encodings store an image, by definition: channels, mosaics, planes of brightness and colour."""

from collections.abc import Callable

import numpy as np

# By definition: which channels of an RGBA image an encoding stores, in which order.
CHANNELS = {
    "rgb8": "RGB", "bgr8": "BGR", "8UC3": "BGR", "rgba8": "RGBA", "bgra8": "BGRA", "8UC4": "BGRA",
    "rgb16": "RGB", "bgr16": "BGR", "16UC3": "BGR", "rgba16": "RGBA", "bgra16": "BGRA", "16UC4": "BGRA",
    "mono8": "R", "8UC1": "R", "mono16": "R",
}  # fmt: skip


def in_turns(*planes: np.ndarray) -> np.ndarray:
    """The columns of several planes in turns."""
    return np.dstack(planes).reshape(len(planes[0]), -1)


def semi_planar(y: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Brightness, then both colours in turns, in rows as wide."""
    return np.concatenate([y, in_turns(first, second).reshape(-1, y.shape[1])])


# By definition: (colour shared across, down, the stored rows of a Y plane and its U and V).
YUV: dict[str, tuple[int, int, Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]]] = {
    "yuyv": (2, 1, lambda y, u, v: in_turns(y[:, 0::2], u, y[:, 1::2], v)),
    "uyvy": (2, 1, lambda y, u, v: in_turns(u, y[:, 0::2], v, y[:, 1::2])),
    "nv12": (2, 2, semi_planar),
    "nv21": (2, 2, lambda y, u, v: semi_planar(y, v, u)),
    "nv16": (2, 1, semi_planar),
    "nv24": (1, 1, semi_planar),
    "i420": (2, 2, lambda y, u, v: np.concatenate([y.ravel(), u.ravel(), v.ravel()]).reshape(-1, y.shape[1])),
}
YUV |= {"yuv422_yuy2": YUV["yuyv"], "yuy2": YUV["yuyv"], "yuv422": YUV["uyvy"]}
