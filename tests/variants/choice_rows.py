"""Channels beside those that count: which one is used."""

from typing import Any

import numpy as np
from analytic_scene import View
from encoders_ros import Encoded
from image_messages import encoded
from label_rows import painted
from tape import (
    COLOR,
    COLOR_LATE_NS,
    DEPTH,
    Draw,
    Part,
    color,
    depth,
    images,
    labels,
    millimetres,
    rgb8,
    together,
)
from variant import Variant

COMPRESSED = f"{COLOR}/compressed"


def black(encoding: str, dtype: str = "u1", channels: int = 1, **options: Any) -> Draw:
    """An image that would spoil everything."""

    def draw(make: Any, stamp_ns: int, view: View) -> Encoded:
        shape = view.labels.shape if channels == 1 else (*view.labels.shape, channels)
        return make.image(stamp_ns, np.zeros(shape, dtype), encoding, **options)

    return draw


def png(make: Any, stamp_ns: int, view: View) -> Encoded:
    """Colour as png."""
    return make.compressed(stamp_ns, encoded(".png", view.rgb), "png")


def empty(fmt: str, head: int = 0) -> Draw:
    """Depth that is nowhere known, as a png behind a head of zeros."""

    def draw(make: Any, stamp_ns: int, view: View) -> Encoded:
        return make.compressed(stamp_ns, bytes(head) + encoded(".png", np.zeros(view.labels.shape, "<u2")), fmt)

    return draw


def beside(topic: str, draw: Draw) -> Part:
    """A channel with a message a frame."""
    return images(topic, COLOR_LATE_NS, draw)


def seldom(part: Part) -> Part:
    """Every second of its messages."""

    def thinned(make: Any, scene: Any) -> Any:
        tape = part(make, scene)
        return type(tape)(tape.messages[::2])

    return thinned


RGB, LEFT = black("rgb8", channels=3), "/left/image_raw"
CHOICE_ROWS = (
    Variant("choice-compressed", "raw and compressed, as many of each: the compressed one",
            color=color(RGB), more=beside(COMPRESSED, png)),
    Variant("choice-most", "half as many compressed ones: the raw one", more=seldom(beside(COMPRESSED, RGB))),
    Variant("choice-colour-word", "another camera without a colour word in its topic",
            more=beside(LEFT, black("mono8"))),
    Variant("choice-grey", "a grey image of the same camera", more=beside("/cam/color/image_mono", black("mono8"))),
    Variant("choice-mosaic", "the mosaic of the same camera, before anybody made colours of it",
            color=color(rgb8, "/cam/color/image_color"), more=beside(COLOR, black("bayer_rggb8"))),
    Variant("choice-infrared", "an infrared camera", more=beside("/cam/infra1/image_rect_raw", black("mono8"))),
    Variant("choice-two-cameras", "a second colour camera, `--topic color=`", more=beside("/rear/color/image_raw", RGB),
            opened={"topics": {"color": COLOR}}),
    Variant("choice-overlay", "labels painted over the image", more=beside("/seg/overlay", RGB)),
    Variant("choice-instances", "ids of things beside those of classes",
            more=beside("/gt/instance_labels", black("mono16", "<u2"))),
    Variant("choice-painted", "a picture of the labels", more=beside("/gt/labels_colored", lambda make, t, v: rgb8(
        make, t, painted(v)))),
    Variant("choice-confidence", "confidence in floats",
            more=beside("/cam/confidence/image", black("32FC1", "<f4"))),
    Variant("choice-aligned", "depth as the sensor saw it beside aligned depth",
            depth=depth(millimetres, "/cam/aligned_depth_to_color/image_raw"),
            more=beside(DEPTH, black("16UC1", "<u2", frame_id="depth_optical"))),
    Variant("choice-depth-transports", "depth as png and compressedDepth beside raw",
            more=together(beside(f"{DEPTH}/compressed", empty("16UC1; png compressed")),
                          beside(f"{DEPTH}/compressedDepth", empty("16UC1; compressedDepth png", 12)))),
    Variant("choice-labels-of-another", "labels of another camera beside those of colour",
            more=together(beside("/rear/image_raw", black("mono8", frame_id="rear")),
                          beside("/rear/semantic", black("mono8", frame_id="rear")))),
    Variant("choice-asked", "every role by `--topic`",
            color=color(rgb8, "/a"), depth=depth(millimetres, "/b"), labels=labels(lambda m, t, v: m.image(
                t, v.labels, "mono8"), "/c"), more=beside("/d/rgb", RGB),
            opened={"topics": {"color": "/a", "depth": "/b", "labels": "/c", "pose": "/tf"}}),
)  # fmt: skip
