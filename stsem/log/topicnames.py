"""What the names of topics tell: words that drivers and simulators use, and which camera a topic belongs to."""

import difflib
import re
from collections.abc import Iterable, Sequence

LABEL_WORDS = (
    "label",  # labels, label_image: Isaac Sim, habitat, this project
    "semantic",  # semantic_segmentation: CARLA bridge, Isaac Sim, Gazebo
    "segment", "seg",  # segmentation: Unity Perception, AirSim; *_seg: network nodes
    "class",  # class_map, classes
    "annotation",  # exported data sets
    "mask",  # detectron and mmseg nodes
    "groundtruth",
)  # fmt: skip
"""Beginnings of words for images of class ids."""
INSTANCE_WORDS = frozenset({"instance", "instances"})
"""Ids of things instead of classes: CARLA bridge, Isaac Sim."""
OVERLAY_WORDS = frozenset({"overlay", "blend", "blended", "annotated"})
"""Labels or boxes painted over the image: network nodes."""
PAINTED_WORDS = frozenset({"debug", "visualization", "viz", "colored", "colorized", "colormap"})
"""Pictures for people: network nodes, RealSense colorizer, Isaac Sim."""
DEPTH_WORDS = ("depth", "disparity")
"""Beginnings of words for depth: REP 118, all RGB-D drivers."""
COLOUR_WORDS = frozenset({"color", "colour", "rgb", "bgr"})
"""RealSense, Azure Kinect and OpenNI2 drivers, ZED."""
INFRARED_WORDS = frozenset({"infra", "infra1", "infra2", "ir", "thermal", "lwir", "nir", "flir", "lepton"})
"""RealSense (infra), Azure Kinect and OpenNI2 (ir), thermal cameras; their 16 bits are no depth."""
NO_DEPTH_WORDS = frozenset({"confidence", "variance", "uncertainty", "normals", "flow", "cost", "intensity"})
"""Floats per pixel that are no depth: ZED, stereo nodes, lidar drivers."""
ALIGNED_WORDS = frozenset({"aligned", "registered"})
"""Depth on the pixels of the colour camera: RealSense (aligned_depth_to_color), OpenNI2 (depth_registered), ZED."""
RECTIFIED_WORDS = frozenset({"rect", "rectified", "undistorted"})
"""Without lens distortion: image_proc, stereo_image_proc, ZED."""
SIDE_WORDS = frozenset({"left", "right"})
"""Of a stereo pair: ZED, stereo_image_proc, OAK."""
TRUTH_WORDS = frozenset({"gt", "groundtruth", "truth", "vicon", "mocap", "optitrack", "vrpn", "qualisys"})
"""Poses that are measured from outside: motion capture drivers, simulators, exported data sets."""
NO_POSE_WORDS = frozenset({"goal", "target", "initial", "initialpose", "setpoint", "waypoint", "cmd", "command"})
"""Poses where the robot shall be: nav2, rviz, mavros."""
TRANSPORTS = frozenset({"compressed", "compresseddepth", "raw", "theora", "ffmpeg", "zstd", "draco"})
"""Last parts that image_transport adds."""


def words(topic: str) -> frozenset[str]:
    """Words of a topic, in lower case; digits stay with the letters before them."""
    return frozenset(_words(topic))


def _words(topic: str) -> list[str]:
    return re.findall(r"[a-z]+\d*|\d+", re.sub(r"([a-z])([A-Z])", r"\1_\2", topic).lower())


def told(topic: str) -> str:
    """ "labels" or "depth", by the last word of the topic that tells, transports left aside; "" when none does."""
    for word in reversed(_words("/".join(without_transport(topic)))):
        for nature, beginnings in (("labels", LABEL_WORDS), ("depth", DEPTH_WORDS)):
            if word.startswith(beginnings):
                return nature
    return ""


def parts(topic: str) -> tuple[str, ...]:
    """What stands between the slashes."""
    return tuple(part for part in topic.split("/") if part)


def without_transport(topic: str) -> tuple[str, ...]:
    """The parts of a topic but those that image_transport added: equal for all transports of one channel."""
    names = parts(topic)
    while len(names) > 1 and names[-1].lower() in TRANSPORTS:
        names = names[:-1]
    return names


def camera(topic: str) -> tuple[str, ...]:
    """The camera that an image topic belongs to: the topic without transport and without image_*."""
    names = without_transport(topic)
    return names[:-1] if len(names) > 1 and names[-1].lower().startswith("image") else names


def common(a: Sequence[str], b: Sequence[str]) -> int:
    """Length of the common beginning."""
    same = 0
    for x, y in zip(a, b, strict=False):
        if x != y:
            break
        same += 1
    return same


def nearest_first(topic: str, topics: Iterable[str]) -> list[str]:
    """`topics`, each once, those that read most like `topic` first."""
    names = sorted(set(topics))
    return sorted(names, key=lambda name: -difflib.SequenceMatcher(None, topic, name).ratio())
