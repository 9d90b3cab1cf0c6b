"""Channels of transforms and poses as the scan leaves them, without a file."""

from collections.abc import Iterable

import numpy as np
from made_up_logs import LEVEL, ROS
from mcap.records import Schema

from stsem.log.container.damage import Damage
from stsem.log.schemas.messages import Transform
from stsem.log.tracks import Samples, Track
from stsem.pose import Pose, from_quaternion

MS = 1_000_000
Vector = tuple[float, float, float]
Q = tuple[float, float, float, float]
Sample = tuple[int | None, int, str, str, Vector, Q]


def turn(degrees: float) -> Q:
    """About z."""
    half = np.deg2rad(degrees) / 2
    return (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))


def track(topic: str, *samples: Sample, schema: str = "tf2_msgs/msg/TFMessage") -> Track:
    """A channel with samples (stamp, log time, parent, child, translation, quaternion)."""
    made = Track(topic, Schema(id=1, name=schema, encoding="ros2msg", data=ROS.schema(schema)), "cdr", Damage())
    for stamp, log, parent, child, t, q in samples:
        made.transforms.setdefault((parent, child), Samples()).add(Transform(stamp, parent, child, t, q), log)
    made.count = len(samples)
    return made


def odometry(topic: str, *samples: Sample) -> Track:
    """A channel of odometry."""
    return track(topic, *samples, schema="nav_msgs/msg/Odometry")


def stamped(topic: str, *samples: Sample) -> Track:
    """A channel of poses without a child frame."""
    return track(topic, *samples, schema="geometry_msgs/msg/PoseStamped")


def line(parent: str, child: str, stamps_ms: Iterable[float], speed: float = 1.0, late_ms: float = 2) -> list[Sample]:
    """A drive along y from 0 at stamp 0, `speed` m/s, without turning."""
    return [
        (round(s * MS), round((s + late_ms) * MS), parent, child, (0.0, speed * s / 1000, 0.0), LEVEL)
        for s in stamps_ms
    ]  # fmt: skip


def pose(t: Vector, q: Q = LEVEL) -> Pose:
    """T from translation and quaternion."""
    return from_quaternion(t, q)
