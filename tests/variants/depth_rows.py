"""Depth: every encoding, unknown pixels in every spelling, and depth that is not on colour's pixels."""

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from analytic_scene import BASE_CAMERA, Scene, View, camera_pose, link, seen
from image_messages import encoded
from rvl_writer import rvl
from tape import (
    DEPTH,
    DEPTH_LATE_NS,
    FRAME,
    INFO,
    TF,
    Draw,
    Message,
    Part,
    Tape,
    base_transform,
    calibration,
    depth,
    images,
    millimetres,
    moving,
    static,
    together,
)
from variant import Equal, Variant

from stsem.camera import Camera
from stsem.pose import Pose
from tests.made_up_lens import RIG

Array = np.ndarray[Any, Any]
DEPTH_FRAME, DEPTH_INFO = "depth_optical", "/cam/depth/camera_info"
LARGER = Camera(96, 72, 75.0, 75.0, 47.5, 35.5)
QUANTISATION, FARTHEST_M = 100.0, 10.0
INVERSE = (QUANTISATION * (QUANTISATION + 1), 1 - QUANTISATION * (QUANTISATION + 1) / FARTHEST_M)
"""a and b of ROS compressed_depth_image_transport: stored = a / metres + b."""


def raw(pixels: Callable[[View], Array], encoding: str, **options: Any) -> Part:
    """Depth as raw images."""
    return depth(lambda make, t, view: make.image(t, pixels(view), encoding, **options))


def compressed(data: Callable[[View], bytes], form: str, transport: str = "compressedDepth") -> Part:
    """Depth as files."""
    return depth(lambda make, t, view: make.compressed(t, data(view), form), f"{DEPTH}/{transport}")


def _saturated(view: View) -> Array:
    return np.where(view.mm > 0, view.mm, 65535).astype("<u2")


def _metres(view: View) -> Array:
    return view.metres.astype("<f4")


def _spelled_unknown(view: View) -> Array:
    """NaN, infinities, zero and a negative number in turns where nothing is known."""
    metres, unknown = _metres(view), np.flatnonzero(view.mm == 0)
    metres.flat[unknown] = np.resize(np.array([np.nan, np.inf, -np.inf, 0.0, -1.0], "<f4"), len(unknown))
    return metres


def _header(view: View, *, inverse: bool) -> tuple[bytes, Array]:
    """The twelve bytes in front, and the samples behind."""
    if not inverse:
        return struct.pack("<iff", 0, 0.0, 0.0), view.mm
    a, b = INVERSE
    stored = np.nan_to_num(np.rint(a / view.metres.astype(np.float64) + b), nan=0).astype(np.uint16)
    return struct.pack("<iff", 0, a, b), stored


def _in_png(view: View, *, inverse: bool = False) -> bytes:
    head, stored = _header(view, inverse=inverse)
    return head + encoded(".png", stored)


def _in_rvl(view: View, *, inverse: bool = False) -> bytes:
    head, stored = _header(view, inverse=inverse)
    height, width = stored.shape
    return head + struct.pack("<II", width, height) + rvl(stored)


QUANTISED = Equal(depth_m=0.002, map=False)
ENCODINGS = (
    Variant("depth-16UC1", "`16UC1`: millimetres, 0 unknown", depth=raw(lambda v: v.mm.astype("<u2"), "16UC1")),
    Variant("depth-mono16", "`mono16`: the same", depth=raw(lambda v: v.mm.astype("<u2"), "mono16")),
    Variant("depth-big-endian", "`16UC1` with `is_bigendian`", depth=raw(lambda v: v.mm.astype(">u2"), "16UC1")),
    Variant("depth-65535", "`16UC1` where 65535 is unknown", depth=raw(_saturated, "16UC1")),
    Variant("depth-padding", "rows filled up by 6 bytes", depth=raw(lambda v: v.mm.astype("<u2"), "16UC1", padding=6)),
    Variant("depth-32FC1", "`32FC1`: metres, NaN unknown", depth=raw(_metres, "32FC1")),
    Variant("depth-32FC1-unknowns", "`32FC1`: NaN, Inf, 0 and below unknown", depth=raw(_spelled_unknown, "32FC1")),
    Variant("depth-32FC1-big-endian", "`32FC1` with `is_bigendian`",
            depth=raw(lambda v: _metres(v).astype(">f4"), "32FC1")),
    Variant("depth-64FC1", "`64FC1`: metres", depth=raw(lambda v: _metres(v).astype("<f8"), "64FC1")),
    Variant("depth-png", "png of 16 bits", depth=compressed(lambda v: encoded(".png", v.mm), "16UC1; png", "png")),
    Variant("depth-compressed-png", "compressedDepth: millimetres as png",
            depth=compressed(_in_png, "16UC1; compressedDepth png")),
    Variant("depth-compressed-bare", "compressedDepth whose format lost its words", depth=compressed(_in_png, "png")),
    Variant("depth-compressed-rvl", "compressedDepth: millimetres as RVL",
            depth=compressed(_in_rvl, "16UC1; compressedDepth rvl")),
    Variant("depth-inverse-png", "compressedDepth: inverse depth as png", equal=QUANTISED,
            depth=compressed(lambda v: _in_png(v, inverse=True), "32FC1; compressedDepth")),
    Variant("depth-inverse-rvl", "compressedDepth: inverse depth as RVL", equal=QUANTISED,
            depth=compressed(lambda v: _in_rvl(v, inverse=True), "32FC1; compressedDepth rvl")),
)  # fmt: skip


def elsewhere(camera: Camera, T_color_depth: Pose, frame_id: str = DEPTH_FRAME) -> Part:
    """Depth as another camera on the same rig sees it, with its calibration unless it is in colour's frame."""

    def part(make: Any, scene: Scene) -> Tape:
        messages = []
        for i in range(scene.frames):
            stamp = scene.stamp_ns(i)
            view = seen(camera, camera_pose(i) @ T_color_depth)
            image = make.image(stamp, view.metres.astype("<f4"), "32FC1", frame_id=frame_id)
            messages.append(Message(DEPTH, image, stamp + DEPTH_LATE_NS))
        if frame_id == FRAME:
            return Tape(tuple(messages))
        about = {"width": camera.width, "height": camera.height, "k": camera.K.ravel().tolist(), "frame_id": frame_id}
        return Tape(tuple(messages)) + calibration(DEPTH_INFO, **about)(make, scene)

    return part


def rig(T_color_depth: Pose, topic: str) -> Part:
    """The plain poses, and where the depth camera sits."""
    links = link("base", FRAME, BASE_CAMERA), link(FRAME, DEPTH_FRAME, T_color_depth)
    return together(static(*links, topic=topic), moving(TF, base_transform, np.eye(4)))


def _ahead(make: Any, scene: Scene) -> Tape:
    """Stamps from the future; log times are those of the recorder."""
    found = images(DEPTH, DEPTH_LATE_NS, lambda make, t, view: millimetres(make, t + 400_000_000, view))
    return found(make, scene)


def _late(late_ns: int) -> Part:
    """Stamps of its own, this much later than colour's."""
    draw: Draw = lambda make, t, view: make.image(t + late_ns, view.mm.astype("<u2"), "16UC1")  # noqa: E731
    return images(DEPTH, DEPTH_LATE_NS, draw)


def _in_frame(frame_id: str) -> Part:
    return raw(lambda view: view.mm.astype("<u2"), "16UC1", frame_id=frame_id)


PROJECTED = Equal(depth_m=0.03, depth_share=0.85, map=False, warns=(DEPTH,))
UNREGISTERED = (
    Variant("depth-stamps-apart", "depth stamps 5 ms behind those of colour: the nearest within 20 ms",
            depth=_late(5_000_000)),
    Variant("depth-clock-ahead", "depth of a computer whose clock is 0.4 s ahead: shifted, and said", depth=_ahead,
            equal=Equal(warns=(f"{DEPTH} and /cam/color/image_raw are on two clocks",))),
    Variant("depth-half-size", "half as many pixels each way in colour's frame: registered by the scaled calibration",
            depth=elsewhere(Scene().camera.scaled(32, 24), np.eye(4), FRAME),
            equal=replace(PROJECTED, depth_m=0.1, depth_share=0.8, warns=(f"{INFO} is for 64x48", DEPTH))),
    Variant("depth-other-size", "another size and focal length, extrinsic zero: registered",
            depth=elsewhere(LARGER, np.eye(4)), pose=rig(np.eye(4), "/tf_static"), equal=PROJECTED),
    Variant("depth-other-camera", "a camera of its own, 5 cm beside: registered through tf_static",
            depth=elsewhere(LARGER, RIG), pose=rig(RIG, "/tf_static"), equal=PROJECTED),
    Variant("depth-registered-no", "the same size and frame, but `--depth-registered no`: by calibration and extrinsic",
            depth=elsewhere(replace(Scene().camera, fx=60.0, fy=60.0), RIG), pose=rig(RIG, "/tf_static"),
            opened={"depth_registered": "no"}, equal=replace(PROJECTED, depth_share=0.8)),
    Variant("depth-registered-yes", "in another frame, `--depth-registered yes`: taken as it is",
            depth=_in_frame(DEPTH_FRAME), opened={"depth_registered": "yes"}),
    Variant("depth-unknown-frame", "of colour's size in another frame, nothing known of it: taken as it is, and said",
            depth=_in_frame(DEPTH_FRAME), equal=Equal(warns=(f"{DEPTH} is in frame 'depth_optical'",))),
    Variant("depth-without-extrinsic", "another size in another frame, no extrinsic: not used, and said",
            depth=elsewhere(LARGER, RIG), equal=Equal(depth_m=None, map=False, timing="other", warns=(DEPTH,))),
    Variant("depth-none", "no depth: no map", depth=lambda make, scene: Tape(),
            equal=Equal(depth_m=None, map=False, timing="other")),
)  # fmt: skip
DEPTH_ROWS = (*ENCODINGS, *UNREGISTERED)
