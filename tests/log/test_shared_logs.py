"""The three recorded logs against the facts that were computed from them by other means."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stsem.log.container.files import find_files
from stsem.log.doctor.inspection import inspect_log
from stsem.log.log import Log, open_log
from stsem.log.scan import scan
from stsem.log.sizes import LOOKED_AT
from stsem.pose import Pose, from_quaternion, inverse

NAMES = ("camvid-0016E5-15hz", "replica-floor1", "7scenes-kitchen-a")
pytestmark = pytest.mark.shared_logs


def facts_of(folder: Path, name: str) -> Any:
    return json.loads((folder / f"{name}.facts.json").read_text())


def opened(folder: Path, name: str, **options: Any) -> Log:
    return open_log([folder / f"{name}.mcap"], **options)


@pytest.mark.parametrize("name", NAMES)
def test_counts_times_and_hash(shared_logs: Path, name: str) -> None:
    facts = facts_of(shared_logs, name)
    with opened(shared_logs, name) as log:
        info = log.info
        assert (info.sha256, info.size_bytes, info.profile) == (facts["sha256"], facts["bytes"], facts["profile"])
        assert not info.damage.lossy
        assert info.clock_offsets_ns == {}
        assert {channel.topic for channel in info.channels} == facts["topics"].keys()
        for channel in info.channels:
            expected = facts["topics"][channel.topic]
            assert (channel.count, channel.schema) == (expected["count"], expected["schema"])
            assert channel.first_log_ns == expected["first_log_time_ns"]
            assert channel.last_log_ns == expected["last_log_time_ns"]
        assert (len(log.plans), info.choice.color) == (facts["frames"], facts["colour_topic"])
        assert log.plans[0].stamp_ns == facts["first_colour_stamp_ns"]
        assert log.plans[-1].stamp_ns == facts["last_colour_stamp_ns"]
        assert info.duration_s == pytest.approx(facts["duration_s"], abs=1e-6)
        assert log.period_ns / 1e6 == pytest.approx(facts["colour_period_ms"]["median"], abs=1e-3)
        if facts["K"]:
            assert log.camera is not None
            assert log.camera.K.ravel().tolist() == facts["K"]


@pytest.mark.parametrize("name", NAMES[:2])
def test_class_pixels_are_exact(shared_logs: Path, name: str) -> None:
    facts = facts_of(shared_logs, name)
    with opened(shared_logs, name) as log:
        assert log.classes is not None
        assert list(log.classes.names) == [row["name"] for row in facts["classes"]]
        truth = inspect_log(log, full=True).truth
        assert truth is not None
        assert [c.pixels for c in truth.classes] == [row["pixels"] for row in facts["classes"]]
        assert truth.ignored_share == pytest.approx(facts["ignore"]["share_of_all"], abs=1e-6)
        assert all(plan.has_truth for plan in log.plans)


@pytest.mark.parametrize(("name", "key"), [("replica-floor1", "invalid_pixels"), ("7scenes-kitchen-a", None)])
def test_unknown_depth_is_exact(shared_logs: Path, name: str, key: str | None) -> None:
    facts = facts_of(shared_logs, name)["depth"]
    expected = facts[key] if key else facts["zero_pixels"] + facts["pixels_65535"]
    with opened(shared_logs, name) as log:
        assert all(not plan.missing(frozenset({"depth", "pose"})) for plan in log.plans)
        unknown = sum(
            int(np.isnan(loaded.frame.depth).sum())
            for loaded in log.frames(range(len(log.plans)), depth=True, previous=False, truth=False)
            if loaded.frame is not None and loaded.frame.depth is not None
        )
    assert unknown == expected


def test_the_depth_partner_of_the_kinect_is_11_ms_late(shared_logs: Path) -> None:
    """One depth image per colour image, the one 11 ms later; it arrives with the colour image's frame."""
    with opened(shared_logs, "7scenes-kitchen-a") as log:
        partners = log._partners.depth
        assert partners.tolist() == list(range(500))
        depth = log._depth
        assert depth is not None
        offsets = depth.rows.stamp_ns - np.array([plan.stamp_ns for plan in log.plans])
        assert np.abs(offsets - 11_000_000).max() <= 1


def geometry_agrees(log: Log, i: int, j: int) -> float:
    """Share of the depth pixels of frame i that frame j sees at the same distance (4 %), by the two poses."""
    a, b = (log.frame(k, depth=True, previous=False) for k in (i, j))
    assert a.camera is not None
    assert a.depth is not None
    assert b.depth is not None
    assert a.T_WC is not None
    assert b.T_WC is not None
    K, (height, width) = a.camera.K, a.depth.shape
    v, u = np.mgrid[:height:4, :width:4]
    z = a.depth[::4, ::4]
    points = np.stack([(u - K[0, 2]) / K[0, 0] * z, (v - K[1, 2]) / K[1, 1] * z, z])[:, np.isfinite(z)]
    T_BA: Pose = inverse(b.T_WC) @ a.T_WC
    x, y, seen = T_BA[:3, :3] @ points + T_BA[:3, 3:]
    uu, vv = (np.rint(K[k, k] * w / seen + K[k, 2]).astype(int) for k, w in ((0, x), (1, y)))
    inside = (seen > 0) & (uu >= 0) & (uu < width) & (vv >= 0) & (vv < height)
    there = b.depth[vv[inside], uu[inside]]
    known = np.isfinite(there)
    nearer_or_same = there[known] < seen[inside][known] * 1.04
    same = np.abs(there[known] / seen[inside][known] - 1) < 0.04
    return float(same.sum() / max(1, (same | ~nearer_or_same).sum()))


@pytest.mark.parametrize(("name", "ahead", "least"), [("replica-floor1", 1, 0.99), ("7scenes-kitchen-a", 5, 0.9)])
def test_poses_agree_with_the_geometry(shared_logs: Path, name: str, ahead: int, least: float) -> None:
    """Depth of one frame carried into another by the two poses lands on the depth seen there."""
    with opened(shared_logs, name) as log:
        shares = [geometry_agrees(log, i, i + ahead) for i in range(0, len(log.plans) - ahead, 60)]
    assert np.mean(shares) > least


def test_the_chain_of_the_kitchen_is_the_static_mount_behind_the_moving_base(shared_logs: Path) -> None:
    """The mount of the facts applied by hand to the interpolated base gives the same pose."""
    static = facts_of(shared_logs, "7scenes-kitchen-a")["pose"]["static"]
    mount = np.eye(4)
    for key in ("base_link -> camera_link", "camera_link -> camera_color_optical_frame"):
        mount = mount @ from_quaternion(static[key]["translation"], static[key]["quaternion_xyzw"])
    result = scan(find_files([shared_logs / "7scenes-kitchen-a.mcap"]))
    track = result.tracks["/tf", "cdr", "tf2_msgs/msg/TFMessage"]
    stamps, logs, places, _ = track.transforms["world", "base_link"].arrays()
    with opened(shared_logs, "7scenes-kitchen-a") as log:
        for plan in log.plans[::50]:
            i = int(np.searchsorted(stamps, plan.stamp_ns))
            share = (plan.stamp_ns - stamps[i - 1]) / (stamps[i] - stamps[i - 1])
            found = log.frame(plan.index, depth=False, previous=False).T_WC
            assert found is not None
            base = found @ inverse(mount)
            place = (1 - share) * places[i - 1] + share * places[i]
            np.testing.assert_allclose(base[:3, 3], place, atol=2e-6)  # the facts give six digits
            assert plan.pose_log_ns == logs[i]


def test_replica_poses_are_those_of_the_messages(shared_logs: Path) -> None:
    with opened(shared_logs, "replica-floor1") as log:
        assert log.trajectory is not None
        assert log.trajectory.stamps_ns.tolist() == [plan.stamp_ns for plan in log.plans]
        up = log.trajectory.poses[:, 2, 1]  # the camera's y points down, the world's z up
        assert (up < -0.9).all()


def test_going_through_in_order_opens_each_chunk_at_most_once(shared_logs: Path) -> None:
    """And holds no more than the cache may."""
    for name in NAMES:
        with opened(shared_logs, name) as log:
            to_open = log._store.decompressed
            assert to_open <= 2 * LOOKED_AT + 3  # sizes of colour and depth, and a look at three channels
            for _ in log.frames(range(len(log.plans)), depth=True, previous=True, truth=True):
                assert log._store.held_bytes <= log._store._limit
            assert log._store.decompressed - to_open <= len(log._store._chunks)


@pytest.mark.parametrize("name", NAMES[:1])
def test_damage_is_named_and_the_rest_read(shared_logs: Path, name: str, tmp_path: Path) -> None:
    data = (shared_logs / f"{name}.mcap").read_bytes()
    path = tmp_path / "damaged.mcap"
    draw = np.random.Generator(np.random.PCG64(3))
    for _ in range(5):
        at = int(draw.integers(1000, len(data) - 50_000))
        flipped = bytearray(data)
        flipped[at] ^= 1 << int(draw.integers(8))
        path.write_bytes(flipped)
        with open_log([path]) as log:
            lost = log.info.damage.counts.get("lost_message", {}).get("/camera/color/image_raw/compressed", 0)
            assert len(log.plans) == 101 - lost
            assert log.info.damage.lossy == (lost > 0)
        path.write_bytes(data[:at])
        with open_log([path]) as log:
            assert log.info.damage.counts == {"truncated": {"": 1}}
            assert 0 < len(log.plans) <= 101
