"""Loops: places recognised, poses right, and rooms that look exactly alike kept apart."""

import numpy as np
import pytest

from stsem.pose import inverse
from stsem.slam.loops import REST, Loops
from stsem.slam.posegraph import Edge, relax, residuals
from stsem.slam.recall import Recall
from stsem.slam.verify import View, depth_agreement, verify
from tests.slam.made_up_rooms import Room, bent, facing, nothing, off_by

HERE = facing(2.0, 2.0, 20)


def test_recall_finds_the_view_with_the_same_points() -> None:
    """Of 40 views of 40 rooms, the second visit of each room is most like its first; what is shared by all is not."""
    recall = Recall()
    rooms = [Room((0, 0), look) for look in range(40)]
    for k, room in enumerate(rooms):
        recall.add(recall.words(room.view(HERE, k).landmarks.descriptors))
    assert len(recall) == 40
    for k in (0, 17, 39):
        words = recall.words(rooms[k].view(facing(2.2, 1.8, 26), 100 + k).landmarks.descriptors)
        alike = recall.similarity(words)
        assert int(alike.argmax()) == k
        assert alike[k] > 3 * np.delete(alike, k).max()


def test_recall_of_nothing() -> None:
    recall = Recall()
    none = recall.words(np.empty((0, 32), np.uint8))
    recall.add(none)
    recall.add(recall.words(np.zeros((3, 32), np.uint8)))
    assert recall.similarity(none).tolist() == [0.0, 0.0]
    assert recall.similarity(recall.words(np.zeros((3, 32), np.uint8)))[0] == 0.0


def test_verify_gives_the_pose_and_an_honest_information() -> None:
    """Within a centimetre, and the squared error in variances is what six numbers have, not ten times that."""
    room, chi2 = Room((0, 0), 1), []
    for k in range(8):
        there = facing(2.3 - 0.1 * k, 1.7, 20 + 3 * k)
        found = verify(room.view(HERE, k), room.view(there, 50 + k), seed=k)
        assert found is not None
        metres, degrees = off_by(found.T, inverse(HERE) @ there)
        assert metres < 0.015
        assert degrees < 0.3
        r = residuals(np.array([HERE, there]), [Edge(0, 1, found.T, found.information)])[0]
        chi2.append(r @ found.information @ r)
    assert np.mean(chi2) < 12


def test_another_room_or_another_depth_is_no_match() -> None:
    room = Room((0, 0), 1)
    assert verify(room.view(HERE, 0), Room((0, 0), 2).view(HERE, 1), seed=0) is None
    view = room.view(HERE, 0)
    moved_walls = room.view(facing(3.2, 2.0, 20), 0).grid
    assert verify(view, View(view.landmarks, moved_walls, view.camera), seed=0) is None
    assert verify(nothing(), view, seed=0) is None
    assert depth_agreement(nothing().grid, view.grid, np.eye(4)) == (0.0, 0.0)


def test_rooms_that_look_alike_are_kept_apart_and_a_return_is_found() -> None:
    """A turn in room A, a walk to B, its exact copy next door, a turn there, and back to A with 40 cm of drift."""
    a, b = Room((0, 0), 5), Room((0, 4), 5)
    turn = [facing(2.4, 2.0, 12 * k) for k in range(30)]
    across = [facing(2.4, 2.0 + k / 2, 0) for k in range(1, 8)]
    there = [facing(2.4, 6.0, 12 * k) for k in range(30)]
    walk = [*turn, *across, *there, *reversed(across), *turn[:6]]
    rooms = [a] * 30 + [None] * 7 + [b] * 30 + [None] * 7 + [a] * 6
    loops, poses, edges = Loops(0), [], []
    for k, (pose, room) in enumerate(zip(walk, rooms, strict=True)):
        poses.append(bent(pose, 0.4 * k / len(walk), 3.0 * k / len(walk)))
        edges += loops.add(nothing() if room is None else room.view(pose, k), poses)
    closed_at = sorted({edge.second for edge in edges})
    for visit in (range(27, 30), range(64, 67), range(74, 80)):  # full turns, and the return
        assert set(closed_at) & set(visit)
    assert min(np.diff(closed_at)) > REST
    for edge in edges:
        assert rooms[edge.first] is rooms[edge.second]
        metres, degrees = off_by(edge.T, inverse(walk[edge.first]) @ walk[edge.second])
        assert metres < 0.03
        assert degrees < 0.5
    odometry = [
        Edge(k, k + 1, inverse(poses[k]) @ poses[k + 1], np.diag([1e3] * 3 + [1e4] * 3)) for k in range(len(poses) - 1)
    ]
    closed = relax(np.array(poses), [*odometry, *edges]).poses
    assert off_by(inverse(closed[0]) @ closed[-1], inverse(walk[0]) @ walk[-1])[0] < 0.03
    assert {one.outcome for one in loops.tried} >= {"loop", "no match", "too far"}


def test_a_single_look_alike_view_is_not_enough() -> None:
    """One earlier view that matches, whose neighbours do not, is left alone."""
    room, other = Room((0, 0), 3), Room((0, 0), 4)
    loops, poses = Loops(0), []
    for k in range(20):
        pose = facing(2.0, 2.0, 6 * k)
        poses.append(pose)
        assert loops.add((room if k == 1 else other).view(pose, k) if k < 8 else nothing(), poses) == []
    poses.append(facing(2.0, 2.0, 8))
    assert loops.add(room.view(poses[-1], 99), poses) == []
    assert loops.tried[-1].outcome in ("alone", "no match")
    assert "alone" in {one.outcome for one in loops.tried}


def test_repeats_to_the_bit() -> None:
    room = Room((0, 0), 1)
    found = [verify(room.view(HERE, 0), room.view(facing(2.2, 2, 25), 1), seed=4) for _ in range(2)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].T.tobytes() == found[1].T.tobytes()
    assert found[0].information == pytest.approx(found[1].information, rel=0, abs=0)
