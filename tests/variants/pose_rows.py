"""Poses: chains of transforms, odometry and stamped poses, of the camera or of a body."""

from collections.abc import Callable
from typing import Any

import numpy as np
from analytic_scene import BASE_CAMERA, Scene, link
from encoders_ros import NS, Encoded, Link
from family_rows import FOX, JSON, ROS1
from tape import (
    FRAME,
    POSE_LATE_NS,
    TF,
    TF_STATIC,
    Message,
    Part,
    Tape,
    base_transform,
    moving,
    nothing,
    static,
    together,
)
from variant import Equal, Variant

from stsem.pose import Pose, from_quaternion, inverse

MOUNT = from_quaternion((0.11, -0.02, 0.31), (0.02, 0.05, -0.1, 1.0))
"""T_base_mount, somewhere on the way to the camera."""
BODY_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
WAIST = link("base", FRAME, BASE_CAMERA)
NOWHERE = float("nan")


def q(pose: Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(translation, quaternion)."""
    _, _, t, rotation = link("", "", pose)
    return t, rotation


def stamped(make: Any, stamp_ns: int, pose: Pose) -> Encoded:
    """PoseStamped, PoseInFrame."""
    return make.pose(stamp_ns, *q(pose))


def with_covariance(make: Any, stamp_ns: int, pose: Pose) -> Encoded:
    """PoseWithCovarianceStamped."""
    return make.pose_with_covariance(stamp_ns, *q(pose))


def odometry(child: str) -> Callable[[Any, int, Pose], Encoded]:
    """Odometry of `child`."""
    return lambda make, stamp_ns, pose: make.odometry(stamp_ns, *q(pose), "odom", child)


def transform(child: str) -> Callable[[Any, int, Pose], Encoded]:
    """One transform, not in a list."""
    return lambda make, stamp_ns, pose: make.transform(stamp_ns, link("world", child, pose))


def on_tf(child: str, *more: Link, name: str = "tf2_msgs/msg/TFMessage") -> Callable[[Any, int, Pose], Encoded]:
    """world -> `child` on tf, with `more` transforms in the same message."""
    named = {} if name.startswith("tf2") else {"name": name}
    return lambda make, stamp_ns, pose: make.tf(stamp_ns, [link("world", child, pose), *more], **named)


def chain(*links: Link, on: Part) -> Part:
    """Static links, and what moves."""
    return together(static(*links), on)


BASE = moving(TF, base_transform, np.eye(4))


def _scaled(make: Any, stamp_ns: int, pose: Pose) -> Encoded:
    """A quaternion of length 3, the sign turning."""
    parent, child, t, rotation = link("world", "base", pose)
    sign = 3.0 if stamp_ns // 100_000_000 % 2 else -3.0
    return make.tf(stamp_ns, [(parent, child, t, tuple(sign * x for x in rotation))])


def _odd_samples(make: Any, scene: Scene) -> Tape:
    """NaN, a zero quaternion and a sample that comes twice."""
    stamp, pose = scene.samples[2]
    bad: list[Link] = [
        ("world", "base", (NOWHERE, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ("world", "base", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0)),
    ]
    messages = [make.tf(stamp + k, [broken]) for k, broken in enumerate(bad, start=1)]
    messages.append(make.tf(stamp, [link("world", "base", pose)]))
    return Tape(tuple(Message(TF, message, stamp + POSE_LATE_NS) for message in messages))


def _static_behind(make: Any, scene: Scene) -> Tape:
    """The static transform is logged when everything is over."""
    late = scene.stamp_ns(scene.frames) + 5 * NS
    return Tape((Message(TF_STATIC, make.tf(late, [WAIST]), late),))


def _static_often(make: Any, scene: Scene) -> Tape:
    """The static transform is published with every frame."""
    stamps = [scene.stamp_ns(i) for i in range(scene.frames)]
    return Tape(tuple(Message(TF_STATIC, make.tf(t, [WAIST]), t + POSE_LATE_NS) for t in stamps))


def _half_moving(pose: Pose) -> Pose:
    """A frame between world and base whose own motion is even, too: map -> odom of a localisation that drifts."""
    return from_quaternion(0.1 * pose[:3, 3], (0.0, 0.0, 0.0, 1.0))


def _two_links(make: Any, stamp_ns: int, pose: Pose) -> Encoded:
    drift = _half_moving(pose)
    return make.tf(stamp_ns, [link("map", "odom", drift), link("odom", "base", inverse(drift) @ pose)])


def _in_a_crowd(make: Any, scene: Scene) -> Tape:
    """Transforms of other parts of the robot, on the same channel."""
    arm = ("base", "arm", (0.3, 0.0, 0.8), (0.0, 0.0, 0.0, 1.0))
    wheel = ("base", "wheel", (0.0, 0.2, 0.0), (0.0, 1.0, 0.0, 1.0))
    return Tape(tuple(Message(TF, make.tf(t, [arm, wheel]), t + POSE_LATE_NS) for t, _ in scene.samples))


CHAINS = (
    Variant("tf-long-chain", "world -> base -> mount -> camera", pose=chain(
        link("base", "mount", MOUNT), link("mount", FRAME, inverse(MOUNT) @ BASE_CAMERA), on=BASE)),
    Variant("tf-two-moving", "map -> odom and odom -> base both move", pose=chain(
        WAIST, on=moving(TF, _two_links, np.eye(4)))),
    Variant("tf-direct", "world -> camera in one transform", pose=moving(TF, on_tf(FRAME))),
    Variant("tf-static-on-tf", "the static part is repeated on tf", pose=moving(TF, on_tf("base", WAIST), np.eye(4))),
    Variant("tf-static-repeated", "the static part is published with every frame", pose=together(_static_often, BASE)),
    Variant("tf-static-late", "the static part comes last in the log", pose=together(_static_behind, BASE)),
    Variant("tf-slashes", "`/world`, `/base`, `/camera`", pose=chain(
        link("/base", f"/{FRAME}", BASE_CAMERA), on=moving(TF, on_tf("/base"), np.eye(4)))),
    Variant("tf-crowd", "among transforms of other parts of the robot", pose=together(
        chain(WAIST, on=BASE), _in_a_crowd)),
    Variant("tf-ros1-name", "`tf/tfMessage` of old ROS 1", make=ROS1, pose=chain(
        WAIST, on=moving(TF, on_tf("base", name="tf/msg/tfMessage"), np.eye(4)))),
    Variant("tf-quaternions", "quaternions three times too long, of either sign: normalised, and said",
            pose=chain(WAIST, on=moving(TF, _scaled, np.eye(4))), equal=Equal(warns=("13 transforms world -> base",))),
    Variant("tf-odd-samples", "NaN, a zero quaternion, a sample twice: left out, and said",
            pose=together(chain(WAIST, on=BASE), _odd_samples), equal=Equal(warns=("2 transforms world -> base",))),
    Variant("frame-transform", "foxglove.FrameTransform, one a message", make=FOX, pose=together(
        moving("/transforms", transform("base"), np.eye(4)), static(WAIST))),
    Variant("frame-transforms", "foxglove.FrameTransforms", make=FOX, pose=chain(WAIST, on=BASE)),
    Variant("frame-transform-json", "foxglove.FrameTransform in JSON", make=JSON, pose=together(
        moving("/transforms", transform("base"), np.eye(4)), static(WAIST))),
)  # fmt: skip
TOPICS = (
    Variant("odometry", "nav_msgs/Odometry of a body, and a static transform to the camera",
            pose=chain(WAIST, on=moving("/odom", odometry("base"), np.eye(4)))),
    Variant("odometry-ros1", "the same in ROS 1", make=ROS1,
            pose=chain(WAIST, on=moving("/odom", odometry("base"), np.eye(4)))),
    Variant("odometry-of-camera", "nav_msgs/Odometry whose child is the camera",
            pose=moving("/odom", odometry(FRAME))),
    Variant("odometry-body-alone", "nav_msgs/Odometry of a body, nothing leads to the camera: looks along x, and said",
            pose=moving("/odom", odometry("base_link"), BASE_CAMERA @ inverse(BODY_OPTICAL)),
            equal=Equal(warns=("/odom gives the pose of 'base_link'",))),
    Variant("foxglove-odometry", "foxglove.Odometry of a body, and a static transform", make=FOX,
            pose=chain(WAIST, on=moving("/odom", odometry("base"), np.eye(4)))),
    Variant("foxglove-odometry-json", "the same in JSON", make=JSON,
            pose=chain(WAIST, on=moving("/odom", odometry("base"), np.eye(4)))),
    Variant("pose-stamped", "geometry_msgs/PoseStamped of the camera", pose=moving("/pose", stamped)),
    Variant("pose-stamped-ros1", "the same in ROS 1", make=ROS1, pose=moving("/pose", stamped)),
    Variant("pose-with-covariance", "geometry_msgs/PoseWithCovarianceStamped", pose=moving("/pose", with_covariance)),
    Variant("transform-stamped", "geometry_msgs/TransformStamped of the camera (motion capture)",
            pose=moving("/vicon/camera", transform(FRAME))),
    Variant("pose-in-frame", "foxglove.PoseInFrame", make=FOX, pose=moving("/pose", stamped)),
    Variant("pose-in-frame-json", "foxglove.PoseInFrame in JSON", make=JSON, pose=moving("/pose", stamped)),
    Variant("pose-not-the-goal", "a goal beside the pose: not used",
            pose=together(moving("/camera/pose", stamped), moving("/goal_pose", stamped, np.eye(4)))),
    Variant("pose-chosen", "`--topic pose=` although there is tf",
            pose=together(moving("/pose", stamped), moving(TF, on_tf(FRAME), np.eye(4))),
            opened={"topics": {"pose": "/pose"}}),
    Variant("pose-none", "no poses: no map", pose=nothing, equal=Equal(pose=False, map=False, timing="other")),
)  # fmt: skip
POSE_ROWS = (*CHAINS, *TOPICS)
