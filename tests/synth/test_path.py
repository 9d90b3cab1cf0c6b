"""The walk: through free space and doors, at the pace that was asked for."""

from functools import cache
from itertools import pairwise
from typing import cast

import numpy as np
import pytest

from stsem import chance
from stsem.errors import UsageError
from stsem.synth.floorplan import DOOR_WIDTH, WALL_THICKNESS, FloorPlan, draw_plan
from stsem.synth.furnish import Furnishing
from stsem.synth.materials import Materials
from stsem.synth.mesh import F64, Builder
from stsem.synth.office import Office, build_office
from stsem.synth.path import STEP_S, area_of, pose_at, profile, walk
from stsem.synth.scene import Scene

ELBOW_M = 0.3


furnished = cache(build_office)


def bare(layout: int) -> Office:
    """Walls alone: quick to make."""
    return Office(draw_plan(layout), Builder().build(), cast(Materials, None), Furnishing(), ())


def states_of(office: Office, layout: int, seed: int, seconds: float, speed: str) -> F64:
    return walk(office, chance.hash31(seed, "walk", layout), seconds, profile(speed))


def paces(states: F64) -> F64:
    """(n - 1,) metres per second between the states."""
    return np.asarray(np.linalg.norm(np.diff(states[:, :2], axis=0), axis=1) / STEP_S, np.float64)


def wall_gap(plan: FloorPlan, x: float, y: float) -> float:
    """Metres to the nearest wall in x and y for a point of the corridor or a room; negative inside a wall."""
    room = area_of(plan, x, y)
    if room is None:
        return min(x, plan.length - x, y, plan.width - y)
    found = plan.rooms[room]
    sign = 1.0 if found.yaw == 0 else -1.0
    u, v = sign * (x - found.origin[0]), sign * (y - found.origin[1])
    return min(u, found.width - u, v, found.depth - v)


def in_a_doorway(plan: FloorPlan, x: float, y: float) -> bool:
    """Whether a point is before, in or behind an open door, an elbow away from its posts."""
    for room in plan.rooms:
        sign = 1.0 if room.yaw == 0 else -1.0
        u, v = sign * (x - room.origin[0]), sign * (y - room.origin[1])
        inside = room.door_x + ELBOW_M <= u <= room.door_x + DOOR_WIDTH - ELBOW_M
        if room.is_open and inside and -WALL_THICKNESS - ELBOW_M <= v <= ELBOW_M:
            return True
    return False


@pytest.mark.parametrize("layout", [12, 7003])
def test_the_walk_keeps_clear_of_furniture(layout: int) -> None:
    """Tours of every room in every manner of walking."""
    office = furnished(layout)
    boxes = np.array(office.furnishing.obstacles)
    for seed, speed in enumerate(("steady", "searching", "varying")):
        places = states_of(office, layout, seed, 120, speed)[:, None, :2]
        beyond = np.maximum(np.maximum(boxes[:, :2] - places, places - boxes[:, 2:]), 0)
        assert np.linalg.norm(beyond, axis=2).min() > ELBOW_M


@pytest.mark.parametrize("layout", range(0, 60, 5))
def test_the_walk_leaves_a_room_through_its_door_only(layout: int) -> None:
    """Everywhere else the walls are an elbow away, and within two minutes every open room is visited."""
    office = bare(layout)
    states = states_of(office, layout, layout, 150, "steady")[::5]
    places = [(float(x), float(y)) for x, y in states[:, :2]]
    strays = [p for p in places if wall_gap(office.plan, *p) < ELBOW_M and not in_a_doorway(office.plan, *p)]
    assert strays == []
    visited = {area_of(office.plan, *place) for place in places}
    assert visited == {None} | {room.index for room in office.plan.rooms if room.is_open}


@pytest.mark.render
def test_nothing_at_all_is_in_the_way(scene: Scene) -> None:
    """No surface is crossed between knee and eye, and none is nearer than 15 cm (door handles are 19)."""
    states = states_of(scene.office, 7002, 1, 60, "varying")
    angles = np.arange(16) * 2 * np.pi / 16
    fan = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1).astype(np.float32)
    tracer = scene.tracer
    for height in (0.4, 1.03, 1.25):
        places = states[::5, :3].astype(np.float32)
        places[:, 2] = height
        moved = np.linalg.norm(np.diff(places, axis=0), axis=1) > 1e-6
        crossed = tracer.occluded(np.ascontiguousarray(places[:-1][moved]), np.ascontiguousarray(places[1:][moved]))
        assert not crossed.any()
        free = tracer.distance(places.repeat(16, axis=0), np.tile(fan, (len(places), 1)))
        assert free.min() > 0.15


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("layout", [0, 23, 34, 7001])
def test_a_steady_walk_has_half_a_metre_per_second(layout: int, seed: int) -> None:
    """Also after the first tour; only where it turns about, in the middle of a room, one step is shorter."""
    states = states_of(bare(layout), layout, seed, 150, "steady")
    pace = paces(states)
    assert pace.max() < 0.505
    assert (np.abs(pace - 0.5) > 0.01).mean() < 0.004
    slow = np.flatnonzero(pace < 0.45)
    assert all(b - a > 50 for a, b in pairwise(slow.tolist()) if b - a > 5)
    assert (pace < 0.02).mean() < 0.001


def test_a_varying_walk_pauses_and_hurries() -> None:
    """Between 0.35 and 0.85 m/s while walking, about three stretches in ten standing."""
    pace = np.concatenate([paces(states_of(bare(k), k, k, 120, "varying")) for k in range(6)])
    assert pace.max() <= 0.86
    assert 0.1 < (pace < 0.02).mean() < 0.4
    assert np.quantile(pace, 0.95) > 0.7


@pytest.mark.parametrize(("speed", "limit"), [("steady", 45.0), ("searching", 45.0), ("varying", 90.0)])
def test_it_turns_no_faster_than_asked(speed: str, limit: float) -> None:
    """Yaw up to the limit (and it gets there), pitch up to half of it, looking neither at its feet nor at the sky."""
    office = furnished(12)
    states = states_of(office, 12, 5, 120, speed)
    yaw, pitch = (np.degrees(np.abs(np.diff(states[:, k])).max() / STEP_S) for k in (3, 4))
    assert 0.8 * limit < yaw <= limit + 1e-6
    assert pitch <= limit / 2 + 1e-6
    assert np.degrees(states[:, 4]).min() > -25
    assert np.degrees(states[:, 4]).max() < 11


def test_a_steady_walk_mostly_looks_along_the_way_and_a_search_mostly_elsewhere() -> None:
    """Degrees per second, the middle one of three minutes in each of two offices."""
    middle = {}
    for speed in ("steady", "searching"):
        yaw = [states_of(furnished(layout), layout, 5, 180, speed)[:, 3] for layout in (12, 7003)]
        middle[speed] = np.degrees(np.median(np.abs(np.concatenate([np.diff(one) for one in yaw])))) / STEP_S
    assert middle["steady"] < 20 < 25 < middle["searching"]


def test_poses_are_optical_and_in_between_states() -> None:
    """x right, y down, z forward, all at right angles; z follows the yaw, y points to the floor."""
    states = states_of(bare(4), 4, 4, 20, "varying")
    for time_s in (0.0, 3.337, 11.01, 19.99):
        pose = pose_at(states, time_s)
        rotation = pose[:3, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        yaw, pitch = (np.interp(time_s / STEP_S, np.arange(len(states)), states[:, k]) for k in (3, 4))
        forward = np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)
        np.testing.assert_allclose(rotation[:, 2], forward, atol=1e-9)
        assert rotation[2, 1] < -0.9
        assert abs(rotation[2, 0]) < 1e-12
        assert pose[2, 3] == 1.25


def test_unknown_speed_is_named() -> None:
    """The sentence lists what there is."""
    with pytest.raises(UsageError, match="'fast'; give steady, searching, varying"):
        profile("fast")
