"""The choice of channels: what would be used of a log, told by topics, schemas and the first message."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from made_up_logs import BASE_NS, LEVEL, PERIOD_NS, ROS, Recorder, label_picture, picture

from stsem.errors import ChannelError, UsageError
from stsem.log.info import Choice
from stsem.log.log import open_log

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
K = [30.0, 0, 15.5, 0, 30.0, 11.5, 0, 0, 1]
DEPTH = np.full((24, 32), 1000, "<u2")


def jpeg(i: int) -> bytes:
    return bytes(cv2.imencode(".jpg", picture(i))[1])


def record(path: Path, topics: dict[str, str], frames: int = 3) -> Path:
    """A log with the given topics, each of one of a few kinds of messages."""
    log = Recorder(path)
    for i in range(frames):
        stamp = BASE_NS + i * PERIOD_NS
        for topic, kind in topics.items():
            kind, _, frame = kind.partition("@")
            frame = frame or "camera"
            match kind:
                case "rgb" | "mono" | "depth" | "odd" | "labels":
                    encoding = {
                        "rgb": "rgb8",
                        "mono": "mono8",
                        "depth": "16UC1",
                        "odd": "tetrachrome",
                        "labels": "mono8",
                    }
                    pixels = {"rgb": picture(i), "odd": picture(i), "depth": DEPTH}.get(kind, label_picture(i))
                    log.ros(topic, IMAGE, ROS.image(stamp, pixels, encoding[kind], frame_id=frame), stamp)
                case "jpeg":
                    log.ros(topic, COMPRESSED, ROS.compressed(stamp, jpeg(i), "jpeg", frame), stamp)
                case "h264":
                    log.ros(topic, COMPRESSED, ROS.compressed(stamp, b"\0\0\0\1g", "h264", frame), stamp)
                case "info":
                    log.ros(topic, "sensor_msgs/msg/CameraInfo", ROS.camera_info(stamp, 32, 24, K, frame), stamp)
                case "pose":
                    log.ros(topic, "geometry_msgs/msg/PoseStamped", ROS.pose(stamp, (0, 0, 0)), stamp)
                case "tf":
                    payload = ROS.tf(stamp, [("world", frame, (float(i), 0.0, 0.0), LEVEL)])
                    log.ros(topic, "tf2_msgs/msg/TFMessage", payload, stamp)
                case "names":
                    log.ros(topic, "vision_msgs/msg/LabelInfo", ROS.label_info(stamp, {0: "a", 1: "b", 2: "c"}), stamp)
    return log.close()


REALSENSE = {
    "/camera/color/image_raw": "rgb", "/camera/color/camera_info": "info",
    "/camera/depth/image_rect_raw": "depth@depth", "/camera/depth/camera_info": "info@depth",
    "/camera/aligned_depth_to_color/image_raw": "depth", "/camera/aligned_depth_to_color/camera_info": "info",
    "/camera/infra1/image_rect_raw": "mono@infra1", "/camera/infra2/image_rect_raw": "mono@infra2",
}  # fmt: skip

CHOICES = {
    "one camera": ({"/cam": "rgb"}, ("/cam", None, None, None, None)),
    "realsense": (
        REALSENSE,
        (
            "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw", None, None,
            "/camera/color/camera_info",
        ),
    ),
    "raw and compressed of one camera": (
        {"/cam/image_raw": "rgb", "/cam/image_raw/compressed": "jpeg"},
        ("/cam/image_raw/compressed", None, None, None, None),
    ),
    "colour beats grey": ({"/left/image": "mono", "/front/image": "rgb"}, ("/front/image", None, None, None, None)),
    "a grey camera alone": ({"/front/image": "mono"}, ("/front/image", None, None, None, None)),
    "named colour beats unnamed": (
        {"/a/image": "jpeg", "/rgb/image": "jpeg"}, ("/rgb/image", None, None, None, None),
    ),
    "labels by name": (
        {"/cam": "rgb", "/semantic/image": "labels", "/semantic/info": "names"},
        ("/cam", None, None, "/semantic/image", None),
    ),
    "labels in colours": ({"/cam": "rgb", "/cam_seg": "rgb"}, ("/cam", None, None, "/cam_seg", None)),
    "a picture of depth is no colour": (
        {"/cam": "rgb", "/depth_colormap": "rgb"}, ("/cam", None, None, None, None),
    ),
    "tf beats a pose when it leads to the camera": (
        {"/cam": "rgb", "/tf": "tf", "/pose": "pose"}, ("/cam", None, "/tf", None, None),
    ),
    "a pose when tf does not lead to the camera": (
        {"/cam": "rgb", "/tf": "tf@gripper", "/pose": "pose"}, ("/cam", None, "/pose", None, None),
    ),
    "a goal is no pose": ({"/cam": "rgb", "/move/goal_pose": "pose"}, ("/cam", None, None, None, None)),
}  # fmt: skip


@pytest.mark.parametrize(("topics", "expected"), CHOICES.values(), ids=CHOICES.keys())
def test_the_choice(tmp_path: Path, topics: dict[str, str], expected: tuple[str | None, ...]) -> None:
    with open_log([record(tmp_path / "log.mcap", topics)]) as log:
        assert log.info.choice == Choice(*expected)


def test_two_equal_cameras_are_listed(tmp_path: Path) -> None:
    path = record(
        tmp_path / "log.mcap",
        {"/left/image_raw": "rgb", "/right/image_raw": "rgb", "/right/image_raw/compressed": "jpeg"},
    )
    with pytest.raises(ChannelError) as caught:
        open_log([path])
    assert str(caught.value) == (
        "2 cameras could be the colour camera: /left/image_raw (3 messages), /right/image_raw/compressed (3 messages); "
        "choose one with --topic color=TOPIC."
    )
    with open_log([path], topics={"color": "/left/image_raw"}) as log:
        assert log.info.choice.color == "/left/image_raw"


@pytest.mark.parametrize(
    ("topics", "words"),
    [
        (
            {"/pose": "pose"},
            "no colour images; it has /pose (geometry_msgs/msg/PoseStamped, 3 messages); give --topic color=TOPIC",
        ),
        ({"/cam/h264": "h264"}, "The only camera /cam/h264 holds h264 video, which stsem does not decode"),
        ({"/cam": "odd"}, "No image of /cam can be decoded: encoding 'tetrachrome' is not supported, only rgb8"),
    ],
)
def test_logs_without_usable_colour(tmp_path: Path, topics: dict[str, str], words: str) -> None:
    with pytest.raises(ChannelError) as caught:
        open_log([record(tmp_path / "log.mcap", topics)])
    assert words in str(caught.value)


def test_overrides(tmp_path: Path) -> None:
    """What was asked for is used; what does not exist or does not fit is refused, with the topics there are."""
    path = record(tmp_path / "log.mcap", REALSENSE | {"/pose": "pose", "/tf": "tf", "/plain": "mono"})
    asked = {"depth": "/camera/depth/image_rect_raw", "pose": "/pose", "labels": "/plain"}
    with open_log([path], topics=asked) as log:
        choice = log.info.choice
        assert (choice.depth, choice.pose, choice.labels) == tuple(asked.values())
        assert any("no class table names them" in warning for warning in log.info.warnings)
    with pytest.raises(
        ChannelError, match=r"no topic '/camera/color/image' for color; it has /camera/color/image_raw, "
    ):
        open_log([path], topics={"color": "/camera/color/image"})
    with pytest.raises(
        ChannelError, match=r"/tf was given for color, which needs images, but it holds tf2_msgs/msg/TFMessage"
    ):
        open_log([path], topics={"color": "/tf"})
    with pytest.raises(ChannelError, match="which needs poses or transforms, but it holds sensor_msgs/msg/Image"):
        open_log([path], topics={"pose": "/camera/color/image_raw"})
    with pytest.raises(UsageError, match="role 'colour', but the roles are color, depth, pose, labels"):
        open_log([path], topics={"colour": "/cam"})


def test_equally_near_depth_channels_are_said(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap", {"/cam": "rgb", "/a/depth": "depth", "/b/depth": "depth"})
    with open_log([path]) as log:
        assert log.info.choice.depth == "/a/depth"
        assert log.info.warnings == (
            "/a/depth, /b/depth could all be the depth channel; /a/depth is used (--topic depth=TOPIC).",
        )  # fmt: skip
