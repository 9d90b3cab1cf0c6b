"""A smooth walk through an office: where the camera is, and what it looks at."""

from dataclasses import dataclass

import numpy as np

from stsem.chance import generator
from stsem.errors import UsageError
from stsem.pose import Pose
from stsem.synth.floorplan import DOOR_WIDTH, FloorPlan, Room
from stsem.synth.furnish import Target
from stsem.synth.mesh import F64
from stsem.synth.office import Office

STEP_S = 0.02
EYE_HEIGHT_M = 1.25
_CORNER_M = 0.22
_AHEAD_M = 0.9
_REST_PITCH = np.radians(-7.0)
_PITCH_RANGE = np.radians(14.0)


@dataclass(frozen=True)
class Profile:
    """How the robot moves.

    Args:
        speeds: least and most walking speed, m/s.
        pause: chance that a stretch of about two seconds is a pause.
        turn_rate: fastest turn, rad/s.
        glance_s: how long it looks at one thing, least and most.
        ahead: chance that it looks along the way for as long, and not at a thing.
        aside: what it glances at is less than this off where it looks now, rad.
    """

    speeds: tuple[float, float]
    pause: float
    turn_rate: float
    glance_s: tuple[float, float]
    ahead: float
    aside: float


_WIDE = float(np.radians(120))
PROFILES = {
    "steady": Profile((0.5, 0.5), 0.0, float(np.radians(45)), (3.0, 5.0), 2 / 3, _WIDE / 2),
    "searching": Profile((0.5, 0.5), 0.0, float(np.radians(45)), (1.6, 2.6), 1 / 6, _WIDE),
    "varying": Profile((0.35, 0.85), 0.3, float(np.radians(90)), (0.9, 1.8), 1 / 6, _WIDE),
}


def profile(name: str) -> Profile:
    """The speed profile `steady`, `searching` or `varying`.

    Raises:
        UsageError: there is no such profile.
    """
    if name not in PROFILES:
        raise UsageError(f"There is no speed profile {name!r}; give {', '.join(PROFILES)}.")
    return PROFILES[name]


def walk(office: Office, seed: int, length_s: float, moves: Profile) -> F64:
    """(n, 5) x, y, z in metres, yaw and pitch in radians of the camera in the world, every STEP_S seconds."""
    steps = int(np.ceil(length_s / STEP_S)) + 2
    along = np.concatenate([[0.0], np.cumsum(_speed(seed, steps, moves))[:-1] * STEP_S])
    track = _track(office.plan, seed, float(along[-1]) + 2 * _AHEAD_M)
    places = np.stack([np.interp(along, track[:, 0], track[:, k]) for k in (1, 2)], axis=1)
    ahead = np.stack([np.interp(along + _AHEAD_M, track[:, 0], track[:, k]) for k in (1, 2)], axis=1)
    yaw, pitch = _gaze(office, seed, places, ahead, moves)
    height = np.full(steps, EYE_HEIGHT_M)
    return np.column_stack([places, height, yaw, pitch])


def pose_at(states: F64, time_s: float) -> Pose:
    """T_WC (4, 4) at `time_s`, optical axes, from the output of `walk`."""
    i = min(int(time_s / STEP_S), len(states) - 2)
    share = time_s / STEP_S - i
    x, y, z, yaw, pitch = states[i] + share * (states[i + 1] - states[i])
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, (x, y, z)
    return pose


def area_of(plan: FloorPlan, x: float, y: float) -> int | None:
    """Index of the room that (x, y) is in; None for the corridor."""
    if 0 <= y <= plan.width:
        return None
    side = [room for room in plan.rooms if (room.yaw == 0) == (y > plan.width)]
    return min(side, key=lambda room: abs(room.to_world(room.width / 2, 0)[0] - x)).index


def _speed(seed: int, steps: int, moves: Profile) -> F64:
    """(steps,) m/s, smooth; stretches of one to three seconds of walking or standing."""
    rng = generator(seed, "speed")
    speed = np.empty(steps)
    i = 0
    while i < steps:
        stretch = int(rng.uniform(1.0, 3.0) / STEP_S)
        stands = rng.random() < moves.pause and i > 0
        speed[i : i + stretch] = 0.0 if stands else rng.uniform(*moves.speeds)
        i += stretch
    return _smoothed(speed, 0.25 / STEP_S)


def _track(plan: FloorPlan, seed: int, length_m: float) -> F64:
    """(n, 3) distance, x, y every centimetre, at least `length_m` long: tours of the open rooms, over and over."""
    rng = generator(seed, "tour")
    nodes: list[tuple[float, float]] = []
    track, wanted_m = np.zeros((1, 3)), length_m
    while track[-1, 0] < length_m:
        while _length(nodes) < wanted_m:
            nodes += _tour(plan, rng, starts=not nodes)
        track = _rounded(_resampled(np.array(nodes)))
        wanted_m = _length(nodes) + length_m - float(track[-1, 0])  # rounding cuts corners
    return track


def _tour(plan: FloorPlan, rng: np.random.Generator, *, starts: bool) -> list[tuple[float, float]]:
    """Corners of a way from the corridor into every open room and out again, in any order."""
    rooms = [room for room in plan.rooms if room.is_open]
    lane = plan.width * 0.58
    nodes: list[tuple[float, float]] = []
    for k in rng.permutation(len(rooms)):
        room = rooms[k]
        door_x = _door_middle(room, 0.0)[0]
        if starts and not nodes:
            offset = 1.6 if door_x < plan.length / 2 else -1.6
            nodes.append((door_x + offset, lane))
        inside = _door_middle(room, room.depth / 2)
        nodes += [(door_x, lane), inside, room.to_world(room.width / 2, room.depth / 2), inside, (door_x, lane)]
    return nodes


def _rounded(points: F64) -> F64:
    """(n, 3) distance, x, y along a polyline whose corners are rounded off."""
    smooth = np.column_stack([_smoothed(points[:, k], _CORNER_M / 0.01) for k in (0, 1)])
    moved = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(moved) > 1e-9])
    return np.asarray(np.column_stack([moved, smooth])[keep], np.float64)


def _door_middle(room: Room, y: float) -> tuple[float, float]:
    return room.to_world(room.door_x + DOOR_WIDTH / 2, y)


def _length(nodes: list[tuple[float, float]]) -> float:
    return float(np.linalg.norm(np.diff(np.array(nodes), axis=0), axis=1).sum()) if len(nodes) > 1 else 0.0


def _resampled(nodes: F64) -> F64:
    """Points every centimetre along a polyline."""
    moved = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(moved) > 1e-9])
    at = np.arange(0.0, moved[-1], 0.01)
    return np.column_stack([np.interp(at, moved[keep], nodes[keep, k]) for k in (0, 1)])


def _smoothed(values: F64, sigma: float) -> F64:
    """Gaussian filter with the ends held."""
    reach = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(values, reach, mode="edge")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="valid"), np.float64)


def _gaze(office: Office, seed: int, places: F64, ahead: F64, moves: Profile) -> tuple[F64, F64]:
    """Yaw and pitch: glances at things nearby, least seen class first, otherwise ahead; a critically damped follow."""
    rng = generator(seed, "gaze")
    seen: dict[int, int] = {}
    direction = ahead[0] - places[0]
    yaw, rate, pitch, pitch_rate = float(np.arctan2(direction[1], direction[0])), 0.0, float(_REST_PITCH), 0.0
    yaws, pitches, target, until = np.empty(len(places)), np.empty(len(places)), None, 0
    stiffness = 5.0
    for i, (x, y) in enumerate(places):
        if i >= until:
            target = _choose(office, seen, (float(x), float(y)), yaw, rng, moves)
            until = i + int(rng.uniform(*moves.glance_s) / STEP_S)
        wanted, wanted_pitch = _towards(target, (float(x), float(y)), ahead[i])
        turn = (wanted - yaw + np.pi) % (2 * np.pi) - np.pi
        rate += (stiffness**2 * turn - 2 * stiffness * rate) * STEP_S
        rate = float(np.clip(rate, -moves.turn_rate, moves.turn_rate))
        pitch_rate += (stiffness**2 * (wanted_pitch - pitch) - 2 * stiffness * pitch_rate) * STEP_S
        pitch_rate = float(np.clip(pitch_rate, -0.5 * moves.turn_rate, 0.5 * moves.turn_rate))
        yaw, pitch = yaw + rate * STEP_S, pitch + pitch_rate * STEP_S
        yaws[i], pitches[i] = yaw, pitch
    return yaws, pitches


def _choose(
    office: Office, seen: dict[int, int], place: tuple[float, float], yaw: float, rng: np.random.Generator,
    moves: Profile,
) -> Target | None:  # fmt: skip
    """Something of this room 1 to 4.5 m away and not too far off to the side; None: look ahead."""
    area = area_of(office.plan, *place)
    near = []
    for target in office.furnishing.targets:
        dx, dy = target.point[0] - place[0], target.point[1] - place[1]
        off = abs((np.arctan2(dy, dx) - yaw + np.pi) % (2 * np.pi) - np.pi)
        if target.room == area and 1.0 < np.hypot(dx, dy) < 4.5 and off < moves.aside:
            near.append(target)
    if not near or rng.random() < moves.ahead:
        return None
    least = min(seen.get(t.label, 0) for t in near)
    pool = [t for t in near if seen.get(t.label, 0) == least]
    chosen = pool[int(rng.integers(len(pool)))]
    seen[chosen.label] = seen.get(chosen.label, 0) + 1
    return chosen


def _towards(target: Target | None, place: tuple[float, float], ahead: F64) -> tuple[float, float]:
    """Wanted yaw and pitch."""
    x, y = (ahead[0], ahead[1]) if target is None else target.point[:2]
    dx, dy = float(x) - place[0], float(y) - place[1]
    if target is None:
        return float(np.arctan2(dy, dx)), float(_REST_PITCH)
    rise = 0.7 * np.arctan2(target.point[2] - EYE_HEIGHT_M, np.hypot(dx, dy))
    low, high = _REST_PITCH - _PITCH_RANGE, _REST_PITCH + _PITCH_RANGE
    return float(np.arctan2(dy, dx)), float(np.clip(rise, low, high))
