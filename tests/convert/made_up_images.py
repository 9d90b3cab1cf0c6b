"""Small analytic images for the data sets of this folder, and what a log made of them says."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from stsem.convert.formats import FORMATS
from stsem.convert.recording import Options, Recording, Summary
from stsem.convert.write import write_recording
from stsem.log.log import Log, open_log

WIDTH, HEIGHT = 32, 24
Read = Callable[[Path, Options], Recording]


def rgb(k: int, width: int = WIDTH, height: int = HEIGHT) -> npt.NDArray[np.uint8]:
    """(H, W, 3) image number `k`: ramps along both sides."""
    v, u = np.mgrid[:height, :width]
    return np.stack([u * 5 + k, v * 7 + k, u + v], axis=2).astype(np.uint8)


def encoded(pixels: npt.NDArray[np.generic], suffix: str = ".png") -> bytes:
    """The bytes of an image file; colours are RGB."""
    ok, data = cv2.imencode(suffix, pixels[:, :, ::-1] if pixels.ndim == 3 else pixels)
    assert ok
    return data.tobytes()


def write(path: Path, content: bytes | str | npt.NDArray[np.generic] | dict[str, object]) -> Path:
    """A file with its folders: bytes, text, an image as png, or json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    match content:
        case bytes():
            path.write_bytes(content)
        case str():
            path.write_text(content)
        case dict():
            path.write_text(json.dumps(content))
        case _:
            path.write_bytes(encoded(content))
    return path


def pose(k: int) -> npt.NDArray[np.float64]:
    """T_WC number `k`: turns about an oblique axis while it moves."""
    axis = np.array([0.2, 1.0, -0.3]) / np.linalg.norm([0.2, 1.0, -0.3])
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(axis * 0.05 * k)[0]
    T[:3, 3] = 0.1 * k, -0.02 * k, 0.3 + 0.05 * k
    return T


@dataclass
class Converted:
    """A data set as a log, opened."""

    log: Log
    summary: Summary


def convert(read: Read, source: Path, out: Path, options: Options | None = None) -> Converted:
    """`source` written as a log and opened."""
    summary = write_recording(read(source, options or Options()), out, lambda done, total: None)
    return Converted(open_log([out]), summary)


def detected(source: Path) -> list[str]:
    """The formats that claim `source`, but for those that take what nothing else does."""
    return [name for name, form in FORMATS.items() if not form.last and form.detect(source)]


def contents(folder: Path) -> dict[str, bytes]:
    """Path below `folder` -> bytes, to see that a conversion changes nothing."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
