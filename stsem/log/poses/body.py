"""Body frames (x forward, z up, REP 103) and optical frames (z forward, y down): which one a pose is of."""

import re

import numpy as np

from stsem.pose import Pose, Trajectory

BODY_OPTICAL: Pose = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""T_body_optical of a camera that looks forward: optical z is body x, optical x is -y, optical y is -z (REP 103)."""

BODY_NAMES = (
    r"base(_link|_footprint|_stabilized|_frame)?",  # REP 105; move_base, nav2, most drivers of mobile bases
    r"body|trunk|torso|pelvis|chassis",  # legged robots (Spot, Unitree), humanoids, cars
    r"(ego_)?vehicle|ego|robot|car|hero",  # CARLA, AirSim, autoware
    r"imu(_link|_frame)?",  # most IMU drivers and visual-inertial odometries
    r"camera_link|\w*camera_center",  # realsense2_camera, zed_wrapper: the mount of the camera, x forward
    r"camera_pose_frame",  # realsense2_camera, T265
    r"(lidar|velodyne|laser|os_sensor)(_link|_frame)?",  # lidar odometries, x forward
)
_BODY = re.compile("|".join(BODY_NAMES))

MIN_SAMPLES, MIN_PATH_M = 20, 1.0
MIN_ALONG_X = 0.8
MIN_UPRIGHT = 0.9
_OPTICAL = re.compile(r"optical(_frame)?$")
_LINK = re.compile(r"_(link|base|mount)$")


def is_body_name(frame: str) -> bool:
    """Whether a frame's name is that of a robot's body, whatever namespace stands before it."""
    return _BODY.fullmatch(frame.split("/")[-1].lower()) is not None


def looks_like_body_frame(trajectory: Trajectory) -> bool:
    """Whether poses are likely those of a body: it moves along its own x axis, and its z axis is near the vertical.

    Told only of 20 samples and a metre of path or more. A camera that looks down and is moved sideways is taken for
    a body.
    """
    if len(trajectory) < MIN_SAMPLES:
        return False
    rotations = trajectory.poses[:-1, :3, :3]
    steps = np.diff(trajectory.poses[:, :3, 3], axis=0)[:, None, :] @ rotations  # own axes, (n - 1, 1, 3)
    lengths = np.linalg.norm(steps, axis=2)
    path = float(lengths.sum())
    if path < MIN_PATH_M:
        return False
    upright = float((np.abs(rotations[:, 2, 2:]) * lengths).sum()) / path
    return upright > MIN_UPRIGHT and float(np.abs(steps[..., 0]).sum()) / path > MIN_ALONG_X


def has_body_axes(frame: str, trajectory: Trajectory) -> bool:
    """Whether a camera's poses are those of a frame with x forward and z up: REP 103's, and not of optical axes.

    Its z axis points up all the way, and it either has the name of a link, or moves along its own x axis. A frame that
    is named optical has optical axes. A camera that looks at the ceiling has z up, too: hence the second condition.
    """
    name = frame.split("/")[-1].lower()
    if _OPTICAL.search(name) or not len(trajectory):
        return False
    if not (is_body_name(name) or _LINK.search(name) or looks_like_body_frame(trajectory)):
        return False
    return bool((trajectory.poses[:, 2, 2] > MIN_UPRIGHT).all())
