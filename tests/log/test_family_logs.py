"""One scene, recorded in every family: the frames are the same."""

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from encoders_foxglove import Fox, Json
from encoders_ros import LEVEL, NS, RosMessages
from made_up_logs import BASE_NS, PERIOD_NS, Recorder, label_picture, picture

from stsem.camera import Camera
from stsem.log.log import Log, open_log

FRAMES = 3
NAMES = {0: "wall", 1: "floor", 2: "door"}
FAMILIES = [RosMessages(2), RosMessages(2, little_endian=False), RosMessages(1), Fox(), Json()]


def record(log: Recorder, make: Any) -> None:
    """Colour, registered depth, a chain of transforms, calibration and labels; class names as the family has them."""
    if isinstance(make, RosMessages):
        log.put("/gt/label_info", make.label_info(BASE_NS, NAMES), BASE_NS)
    else:
        log.writer.add_metadata("stsem.classes", {str(i): name for i, name in NAMES.items()})
    log.put("/tf_static", make.tf(BASE_NS - 3 * NS, [("base", "camera", (0.0, 0.0, 0.5), LEVEL)]), BASE_NS)
    for i in range(FRAMES):
        stamp = BASE_NS + i * PERIOD_NS
        for k in (-50_000_000, 50_000_000):
            link = ("world", "base", (i + k / PERIOD_NS, 0.0, 0.0), LEVEL)
            log.put("/tf", make.tf(stamp + k, [link]), stamp + k + 2_000_000)
        k_matrix = [30, 0, 15.5, 0, 30, 11.5, 0, 0, 1]
        log.put("/cam/color/camera_info", make.camera_info(stamp, 32, 24, k_matrix), stamp + 4_000_000)
        log.put("/cam/color/image_raw", make.image(stamp, picture(i), "rgb8"), stamp + 5_000_000)
        depth = np.full((24, 32), 1000 + i, "<u2")
        log.put("/cam/depth/image_raw", make.image(stamp, depth, "16UC1"), stamp + 6_000_000)
        log.put("/gt/labels", make.image(stamp, label_picture(i), "mono8"), stamp + 7_000_000)


def content(log: Log) -> str:
    """Hash over every pixel, depth, pose and label."""
    found = hashlib.sha256()
    for loaded in log.frames(range(FRAMES), depth=True, previous=False, truth=True):
        assert loaded.frame is not None
        for part in (loaded.frame.image, loaded.frame.depth, loaded.frame.T_WC, loaded.truth):
            assert part is not None
            found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


@pytest.fixture(scope="module")
def in_ros2(tmp_path_factory: pytest.TempPathFactory) -> str:
    log = Recorder(tmp_path_factory.mktemp("ros2") / "log.mcap")
    record(log, FAMILIES[0])
    with open_log([log.close()]) as opened:
        return content(opened)


@pytest.mark.parametrize("make", FAMILIES, ids=["ros2", "ros2-big-endian", "ros1", "protobuf", "json"])
def test_the_same_scene_is_the_same_log_in_every_family(
    make: Any, in_ros2: str, recorder: Callable[..., Recorder]
) -> None:
    log = recorder()
    record(log, make)
    with open_log([log.close()]) as opened:
        assert content(opened) == in_ros2
        assert opened.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert opened.classes is not None
        assert opened.classes.names == tuple(NAMES.values())
        assert not opened.info.damage.lossy
        assert not opened.info.warnings
        np.testing.assert_allclose([opened.frame(1, depth=False, previous=False).T_WC[:3, 3]], [[1, 0, 0.5]])
