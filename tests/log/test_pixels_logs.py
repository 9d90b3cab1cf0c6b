"""Whole logs: whatever way pixels are stored without loss, frames, depth and truth are the same."""

import io
import json
import struct
from collections.abc import Callable

import numpy as np
import pytest
from image_messages import encoded
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, picture
from PIL import Image
from rvl_writer import rvl

from stsem.log.log import open_log

FRAMES = 3
COLOURS = [(10, 20, 30), (40, 50, 60), (255, 0, 1)]
TABLE = json.dumps({"names": ["wall", "floor", "door"], "colours": COLOURS}).encode()
Message = Callable[[int, int], tuple[str, bytes]]


def millimetres(i: int) -> np.ndarray:
    y, x = np.mgrid[:24, :32]
    depth = (900 + 10 * i + 3 * x + y).astype("<u2")
    depth[0, :3] = 0, 65535, 1
    return depth


def raw(encoding: str, pixels: Callable[[int], np.ndarray]) -> Message:
    return lambda i, stamp_ns: ("sensor_msgs/msg/Image", ROS.image(stamp_ns, pixels(i), encoding))


def file(form: str, data: Callable[[int], bytes]) -> Message:
    return lambda i, stamp_ns: ("sensor_msgs/msg/CompressedImage", ROS.compressed(stamp_ns, data(i), form))


def with_alpha(rgb: np.ndarray) -> np.ndarray:
    return np.dstack([rgb, rgb[:, :, 0]])


def palette_labels(i: int) -> bytes:
    image = Image.fromarray(label_picture(i), "L")
    image.putpalette([value for colour in COLOURS for value in colour])
    buffer = io.BytesIO()
    image.save(buffer, "png", bits=8)
    return buffer.getvalue()


def rvl_file(i: int) -> bytes:
    return bytes(12) + struct.pack("<II", 32, 24) + rvl(millimetres(i))


COLOUR: dict[str, Message] = {
    "rgb8": raw("rgb8", picture),
    "bgr8": raw("bgr8", lambda i: picture(i)[:, :, ::-1]),
    "8UC3": raw("8UC3", lambda i: picture(i)[:, :, ::-1]),
    "rgba8": raw("rgba8", lambda i: with_alpha(picture(i))),
    "bgra8": raw("bgra8", lambda i: with_alpha(picture(i)[:, :, ::-1])),
    "rgb16": raw("rgb16", lambda i: picture(i).astype("<u2") * 257),
    "png": file("rgb8; png compressed bgr8", lambda i: encoded(".png", picture(i))),
    "webp": file("webp", lambda i: encoded(".webp", picture(i))),
}
DEPTH: dict[str, Message] = {
    "16UC1": raw("16UC1", millimetres),
    "mono16": raw("mono16", millimetres),
    "32FC1": raw("32FC1", lambda i: np.where(millimetres(i) % 65535 == 0, 0, millimetres(i) / 1000).astype("<f4")),
    "png": file("16UC1; png compressed", lambda i: encoded(".png", millimetres(i))),
    "compressedDepth": file("16UC1; compressedDepth png", lambda i: bytes(12) + encoded(".png", millimetres(i))),
    "rvl": file("16UC1; compressedDepth rvl", rvl_file),
}
LABELS: dict[str, Message] = {
    "mono8": raw("mono8", label_picture),
    "16UC1": raw("16UC1", lambda i: label_picture(i).astype("<u2")),
    "32SC1": raw("32SC1", lambda i: label_picture(i).astype("<i4")),
    "png": file("png", lambda i: encoded(".png", label_picture(i))),
    "palette": file("png", palette_labels),
}


def recorded(log: Recorder, color: Message, depth: Message, labels: Message) -> dict[str, list[np.ndarray]]:
    """Frames, depth and truth of a log of these messages."""
    for i in range(FRAMES):
        stamp = BASE_NS + i * PERIOD_NS
        for topic, message in {"/cam/rgb": color, "/cam/depth": depth, "/gt/labels": labels}.items():
            log.ros(topic, *message(i, stamp), stamp)
    log.writer.add_attachment(0, 0, "classes.json", "application/json", TABLE)
    with open_log([log.close()]) as opened:
        frames = [opened.frame(i, depth=True, previous=False) for i in range(FRAMES)]
        truth = [opened.truth(i) for i in range(FRAMES)]
        assert not opened.info.damage.lossy
        return {"image": [f.image for f in frames], "depth": [f.depth for f in frames], "truth": truth}


@pytest.mark.parametrize(
    ("color", "depth", "labels"),
    [
        *((color, "16UC1", "mono8") for color in COLOUR),
        *(("rgb8", depth, "mono8") for depth in DEPTH),
        *(("png", "rvl", labels) for labels in LABELS),
    ],
)
def test_equal_pixels_are_equal_frames(recorder: Callable[..., Recorder], color: str, depth: str, labels: str) -> None:
    found = recorded(recorder(), COLOUR[color], DEPTH[depth], LABELS[labels])
    for i in range(FRAMES):
        metres = (millimetres(i) / 1000).astype(np.float32)
        metres[0, :2] = np.nan
        np.testing.assert_array_equal(found["image"][i], picture(i))
        np.testing.assert_array_equal(found["depth"][i], metres)
        np.testing.assert_array_equal(found["truth"][i], label_picture(i))
