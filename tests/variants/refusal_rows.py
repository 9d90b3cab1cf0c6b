"""What stsem does not read, and the sentence that it says instead."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from analytic_scene import View
from color_rows import ODD, file
from encoders_ros import Encoded
from image_messages import encoded
from tape import (
    COLOR,
    DEPTH,
    LABELS,
    Draw,
    Part,
    calibration,
    class_metadata,
    color,
    depth,
    images,
    labels,
    nothing,
    rgb8,
)
from variant import Variant

NO_DEPTH = ": depth needs 16 bits or floats of one channel, and is not used."
VIDEO = b"\0\0\0\1\x67" + bytes(40)


@dataclass(frozen=True)
class Refusal:
    """A log that cannot be used, or only in part.

    Args:
        variant: what is recorded.
        says: how the one sentence begins: that of an error, of a warning, or what the damage is; of an unused channel
            its role.
        kind: "error", "warning", "damage" or "unused".
    """

    variant: Variant
    says: str
    kind: str = "error"


def _as(encoding: str) -> Draw:
    """The brightness under an encoding that may not fit."""

    def draw(make: Any, stamp_ns: int, view: View) -> Encoded:
        return make.image(stamp_ns, np.ascontiguousarray(view.rgb[:, :, 0]), encoding)

    return draw


def _video(make: Any, stamp_ns: int, _view: View) -> Encoded:
    return make.video(stamp_ns, VIDEO, "h264")


def _video_as_stills(make: Any, stamp_ns: int, _view: View) -> Encoded:
    return make.compressed(stamp_ns, VIDEO, "h264")


def _stills(data: Callable[[View], bytes], form: str) -> Draw:
    return lambda make, stamp_ns, view: make.compressed(stamp_ns, data(view), form)


def _spoilt_depth(view: View) -> bytes:
    return encoded(".jpg", (view.mm >> 8).astype(np.uint8))


def _lens(model: str) -> Part:
    return calibration(d=(0.1, 0.2), model=model)


REFUSALS = (
    Refusal(
        Variant("refused-video", "h264, h265, vp9, av1 (CompressedVideo)", color=color(_video)),
        f"The only camera {COLOR} holds h264 video, which stsem does not decode; record or convert it as jpeg, png or "
        "raw images.",
    ),
    Refusal(
        Variant("refused-video-as-stills", "the same in CompressedImage", color=color(_video_as_stills)),
        f"The only camera {COLOR} holds h264 video, which stsem does not decode",
    ),
    Refusal(
        Variant("refused-encoding", "a raw encoding that is not in the table above", color=color(_as("yuv9"))),
        f"No image of {COLOR} can be decoded: encoding 'yuv9' is not supported, only rgb8, bgr8, 8UC3,",
    ),
    Refusal(
        Variant("refused-format", "tiff, gif, bmp, avif, heic, jpeg 2000, jpeg xl",
                **file(lambda rgb: encoded(".tiff", rgb), "tiff", COLOR)),
        f"No image of {COLOR} can be decoded: tiff is not supported; record or convert it as jpeg, png, webp or raw "
        "images;",
    ),
    Refusal(
        Variant("refused-odd-nv12", "an encoding that shares colour, in an odd size", scene=ODD,
                color=color(_as("nv12"))),
        f"No image of {COLOR} can be decoded: nv12 needs an even width and height, but 63x47 came;",
    ),
    Refusal(
        Variant("refused-no-color", "no colour images", color=nothing),
        "The log has no colour images; it has /gt/label_info",
    ),
    Refusal(
        Variant("refused-two-cameras", "two colour cameras with an equal claim",
                more=images("/rear/color/image_raw", 5_000_000, rgb8)),
        f"2 cameras could be the colour camera: {COLOR} (12 messages), /rear/color/image_raw (12 messages); choose one "
        "with --topic color=TOPIC.",
    ),
    Refusal(
        Variant("refused-class-names", "two classes of one name", classes=class_metadata({"0": "wall", "1": "Wall"})),
        "The class table metadata stsem.classes cannot be used: The class names",
    ),
    Refusal(
        Variant("refused-no-classes", "labels without a class table", classes=nothing),
        "/gt/labels holds labels, but no class table names them: accuracy cannot be measured (give --classes FILE).",
        kind="warning",
    ),
    Refusal(
        Variant("refused-lens", "a lens after a model that stsem does not know", calibration=_lens("division")),
        "The lens distortion that /cam/color/camera_info states cannot be undone (the distortion model 'division' is "
        "not known, only plumb_bob, rational_polynomial, equidistant): no intrinsics, no map.",
        kind="warning",
    ),
    Refusal(
        Variant("refused-jpeg-labels", "labels in jpeg or webp, which change ids",
                labels=labels(_stills(lambda view: encoded(".jpg", view.labels), "jpeg"), f"{LABELS}/compressed")),
        "undecodable 12 (/gt/labels/compressed); the first of /gt/labels/compressed: labels need a lossless "
        "image (raw or png), but jpeg came ('jpeg'), which changes ids", kind="damage",
    ),
    Refusal(
        Variant("refused-mixed-labels", "labels in an encoding that mixes pixels",
                labels=labels(lambda make, t, v: make.image(t, np.dstack([v.labels, v.labels]), "yuyv"))),
        "undecodable 12 (/gt/labels); the first of /gt/labels: labels need ids or colours as they are, but yuyv came, "
        "which mixes pixels", kind="damage",
    ),
    Refusal(
        Variant("refused-float-labels", "labels in floats",
                labels=labels(lambda make, t, v: make.image(t, v.labels.astype("<f4"), "32FC1"))),
        "labels", kind="unused",
    ),
    Refusal(
        Variant("refused-jpeg-depth", "depth in jpeg or webp, whose 8 bits cannot hold it",
                depth=depth(_stills(_spoilt_depth, "16UC1; jpeg compressed"), f"{DEPTH}/compressed")),
        f"{DEPTH}/compressed says depth, but holds 16UC1; jpeg compressed (jpeg has 8 bits){NO_DEPTH}", kind="warning",
    ),
    Refusal(
        Variant("refused-8-bit-depth", "depth in a png of 8 bits", depth=depth(
            _stills(lambda view: encoded(".png", (view.mm >> 8).astype(np.uint8)), "png"), f"{DEPTH}/compressed")),
        f"{DEPTH}/compressed says depth, but holds png{NO_DEPTH}", kind="warning",
    ),
    Refusal(
        Variant("refused-painted-depth", "depth painted in colours", depth=depth(rgb8)),
        f"{DEPTH} says depth, but holds rgb8{NO_DEPTH}", kind="warning",
    ),
)  # fmt: skip
