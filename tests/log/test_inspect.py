"""What `stsem inspect` is told."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, picture

from stsem.log.doctor.inspection import inspect_log
from stsem.log.doctor.seen import SAMPLED_FRAMES
from stsem.log.log import open_log

IMAGE = "sensor_msgs/msg/Image"


def test_an_inspection_is_plain_data(room_log: Path) -> None:
    with open_log([room_log]) as log:
        document = json.loads(json.dumps(inspect_log(log).as_dict()))
    assert document["used"] == {
        "color": "/cam/color/image_raw", "depth": "/cam/depth/image_raw", "pose": "/tf", "labels": "/gt/labels",
        "calibration": "/cam/color/camera_info",
    }  # fmt: skip
    assert document["frames"] == {
        "count": 6, "with_depth": 6, "with_pose": 6, "with_truth": 6, "width": 32, "height": 24, "period_ms": 100.0,
        "looked_at": 6, "undecodable": 0, "dark": 0, "flat": 0,
    }  # fmt: skip
    color = next(c for c in document["channels"] if c["role"] == "color")
    assert (color["count"], color["rate_hz"], color["largest_gap_s"], color["offset_min_ns"]) == (
        6,
        10.0,
        0.1,
        5_000_000,
    )
    assert document["damage"] == {"lossy": False, "counts": {}}


def test_class_shares_are_of_the_labelled_pixels(room_log: Path) -> None:
    truth = np.stack([label_picture(i) for i in range(6)])
    with open_log([room_log]) as log:
        summary = inspect_log(log).truth
    assert summary is not None
    assert summary.ignored_share == 1 / 24
    assert [(c.name, c.pixels) for c in summary.classes] == [
        (name, int((truth == i).sum())) for i, name in enumerate(("wall", "floor", "door"))
    ]
    assert sum(c.share or 0 for c in summary.classes) == pytest.approx(1)


def test_depth_percentiles_are_the_nearest_rank(recorder: Callable[..., Recorder]) -> None:
    """1..99 mm once each and one hole: p of 99 values is sorted[ceil(0.99 p) - 1]."""
    log = recorder()
    depth = np.arange(100, dtype="<u2").reshape(10, 10)
    log.ros("/cam", IMAGE, ROS.image(BASE_NS, picture(0, 10, 10), "rgb8"), BASE_NS)
    log.ros("/depth", IMAGE, ROS.image(BASE_NS, depth, "16UC1"), BASE_NS)
    with open_log([log.close()]) as opened:
        summary = inspect_log(opened).depth
    assert summary is not None
    assert summary.percentiles_m == {1: 0.001, 5: 0.005, 50: 0.05, 95: 0.095, 99: 0.099}
    assert summary.unknown_share == 0.01


def test_a_log_without_depth_and_truth_says_so(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    log.ros("/cam", IMAGE, ROS.image(BASE_NS, picture(0), "rgb8"), BASE_NS)
    with open_log([log.close()]) as opened:
        inspection = inspect_log(opened)
    assert (inspection.truth, inspection.depth, inspection.camera) == (None, None, None)


def test_long_logs_are_sampled_unless_asked_fully(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for i in range(SAMPLED_FRAMES + 30):
        stamp = BASE_NS + i * PERIOD_NS
        log.ros("/cam", IMAGE, ROS.image(stamp, picture(i, 4, 3), "rgb8"), stamp)
    with open_log([log.close()]) as opened:
        assert inspect_log(opened).frames.looked_at == SAMPLED_FRAMES
        assert inspect_log(opened, full=True).frames.looked_at == SAMPLED_FRAMES + 30
