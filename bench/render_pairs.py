"""Render the pairs that networks are trained on: consecutive frames of offices with their labels, and depth if asked.

    render_pairs.py .scratch/pairs --layouts 0 400 --pairs 10
    render_pairs.py .scratch/paper-pairs/train --layouts 20000 20400 --pairs 5 --size 240 135 --depth

Half of the pairs stand on the walk of a rendered log, half at a free place anywhere, since a walk keeps to its lane.
Layouts 0 to 999 train the shipped network and 5000 to 5099 validate it, 20000 to 22999 are for the paper's tables
(docs/paper-tables.md); the logs that ship have others (7001 to 7003).
"""

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from stsem import chance
from stsem.camera import Camera
from stsem.frame import Image
from stsem.pose import Pose
from stsem.synth.generate import office_camera
from stsem.synth.office import Office
from stsem.synth.path import pose_at, profile, walk
from stsem.synth.scene import Scene
from stsem.synth.sensor import expose, kinect
from stsem.synth.view import View
from stsem.synth.vocabulary import OFFICE
from stsem.train.dataset import Pair, save_pair

FOCALS_PER_WIDTH = 250 / 480, 400 / 480
WALK_S, PERIOD_S = 60.0, 0.1
MARGIN_M = 0.25
ATTEMPTS = 6
JPEG_QUALITY = 85


def walked(layout: int, office: Office, count: int) -> list[tuple[Pose, Pose, float]]:
    """`count` pairs of poses, a period apart and spread over a walk, with the time of the first."""
    states = walk(office, chance.hash31(layout, "walk for training"), WALK_S, profile("varying"))
    rng = chance.generator(layout, "times")
    times = (np.arange(count) + rng.random(count)) * (WALK_S - 1) / count
    return [(pose_at(states, t), pose_at(states, t + PERIOD_S), float(t)) for t in times]


def free(scene: Scene, size: tuple[int, int], rng: np.random.Generator) -> tuple[Pose, Pose, Camera]:
    """Two poses a period apart anywhere on the floor, and a camera of any usual focal length."""
    x, y = _place(scene.office, rng)
    targets = scene.office.furnishing.targets
    yaw = float(rng.uniform(-np.pi, np.pi))
    if targets and rng.random() < 0.6:
        point = targets[int(rng.integers(len(targets)))].point
        yaw = float(np.arctan2(point[1] - y, point[0] - x) + rng.normal(0, 0.25))
    z, pitch, roll = rng.uniform(0.8, 1.5), rng.normal(-0.08, 0.12), rng.normal(0, 0.02)
    width, height = size
    focal = float(np.exp(rng.uniform(*np.log(FOCALS_PER_WIDTH)))) * width
    step, turn, heading = rng.uniform(0, 0.06), rng.normal(0, 0.05), yaw + rng.normal(0, 0.3)
    moved = (x + step * np.cos(heading), y + step * np.sin(heading), z)
    camera = Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    return _pose((x, y, z), yaw, pitch, roll), _pose(moved, yaw + turn, pitch, roll), camera


def _place(office: Office, rng: np.random.Generator) -> tuple[float, float]:
    plan, x, y = office.plan, 0.0, 0.0
    for _ in range(300):
        room = int(rng.integers(-2, len(plan.rooms)))
        if room < 0:
            x, y = float(rng.uniform(0.3, plan.length - 0.3)), float(rng.uniform(0.4, plan.width - 0.4))
        else:
            chosen = plan.rooms[room]
            x, y = chosen.to_world(
                float(rng.uniform(0.4, chosen.width - 0.4)), float(rng.uniform(0.3, chosen.depth - 0.5))
            )
        if not any(a - MARGIN_M < x < c + MARGIN_M and b - MARGIN_M < y < d + MARGIN_M
                   for a, b, c, d in office.furnishing.obstacles):  # fmt: skip
            break
    return x, y


def _pose(place: tuple[float, float, float], yaw: float, pitch: float, roll: float) -> Pose:
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = c * right + s * down, c * down - s * right, forward, place
    return pose


def render(layout: int, count: int, folder: Path, size: tuple[int, int], *, depth: bool) -> None:
    """The pairs of one layout; one whose last pair is there already is skipped."""
    if (folder / f"{layout:05}_{count - 1:02}.npz").exists():
        return
    scene = Scene(layout, layout)
    tour = walked(layout, scene.office, (count + 1) // 2)
    for k in range(count):
        rng = chance.generator(layout, "pair", k)
        if k % 2 == 0:
            first, second, time_s = tour[k // 2]
            camera = office_camera(*size)
            views = [scene.look(camera, first, time_s)]
        else:
            views, time_s = [], float(rng.uniform(0, WALK_S))
            for attempt in range(ATTEMPTS):
                first, second, camera = free(scene, size, rng)
                views = [scene.look(camera, first, time_s)]
                if attempt == ATTEMPTS - 1 or _is_rich(views[0]):
                    break
        views.append(scene.look(camera, second, time_s + PERIOD_S))
        images = np.stack([_recorded(expose(view.radiance, 1.0, rng)) for view in views])
        depths = _measured(views, camera, layout, k) if depth else None
        save_pair(folder / f"{layout:05}_{k:02}.npz", Pair(images, np.stack([view.labels for view in views]), depths))


def _measured(views: list[View], camera: Camera, layout: int, k: int) -> npt.NDArray[np.float32]:
    """(2, H, W) metres as a Kinect gives them, NaN unknown."""
    return np.stack([kinect(view.depth, camera.fx, chance.generator(layout, "depth", k, i))
                     for i, view in enumerate(views)])  # fmt: skip


def _recorded(image: Image) -> Image:
    """The image as a log's JPEG gives it back: its faults are most of the difference when the robot stands."""
    _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return np.asarray(cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB), np.uint8)


def _is_rich(view: View) -> bool:
    """Whether at least four classes show on more than 0.4 % of the image: not a bare wall."""
    shares = np.bincount(view.labels.ravel(), minlength=256) / view.labels.size
    return bool((shares > 0.004).sum() >= 4)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--layouts", type=int, nargs=2, required=True, help="first, and one past the last")
    parser.add_argument("--pairs", type=int, default=10, help="pairs of each layout")
    parser.add_argument("--size", type=int, nargs=2, default=(480, 270), help="width and height, pixels")
    parser.add_argument("--depth", action="store_true", help="keep the depth that a Kinect would measure")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table = {"names": OFFICE.names, "colours": OFFICE.colours}
    (given.folder / "classes.json").write_text(json.dumps(table), encoding="utf-8")
    for number in range(*given.layouts):
        render(number, given.pairs, given.folder, tuple(given.size), depth=given.depth)
        print(number, flush=True)
