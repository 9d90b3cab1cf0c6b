"""The choice of channels: what would be used of a log, told by topics, schemas and the first message."""

from pathlib import Path

import pytest
from channel_kinds import IMAGE, record
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, picture
from mcap.records import Schema

from stsem.errors import ChannelError, UsageError
from stsem.log.candidate import Candidate
from stsem.log.choose import choose_calibration
from stsem.log.container.damage import Damage
from stsem.log.info import Choice
from stsem.log.log import open_log
from stsem.log.pixels.look import Look
from stsem.log.schemas.messages import Calibration
from stsem.log.tracks import Track


def calibration(topic: str, frame_id: str) -> Track:
    """A channel of calibrations in `frame_id`, as the scan leaves it."""
    name = "sensor_msgs/msg/CameraInfo"
    made = Track(topic, Schema(id=1, name=name, encoding="ros2msg", data=ROS.schema(name)), "cdr", Damage())
    made.calibrations.append(Calibration(None, frame_id, None))
    return made


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
    "labels of 16 bits": (
        {"/cam": "rgb", "/semantic/image": "depth", "/info": "names"}, ("/cam", None, None, "/semantic/image", None),
    ),
    "classes before things": (
        {"/cam": "rgb", "/instance_segmentation": "labels", "/semantic_segmentation": "labels", "/info": "names"},
        ("/cam", None, None, "/semantic_segmentation", None),
    ),
    "things alone are no classes": (
        {"/cam": "rgb", "/instance_segmentation": "labels"}, ("/cam", None, None, None, None),
    ),
    "ids before colours": (
        {"/cam": "rgb", "/semantic/colored": "rgb", "/semantic/raw_labels": "labels", "/info": "names"},
        ("/cam", None, None, "/semantic/raw_labels", None),
    ),
    "an overlay is neither labels nor colour": (
        {"/cam/image": "rgb", "/net/semantic_overlay": "rgb"}, ("/cam/image", None, None, None, None),
    ),
    "infrared of 16 bits is no depth": (
        {"/cam": "rgb", "/infra1/image_raw": "depth", "/thermal": "depth"}, ("/cam", None, None, None, None),
    ),
    "confidence is no depth": (
        {"/cam": "rgb", "/zed/confidence_map": "depth", "/zed/range": "depth"},
        ("/cam", "/zed/range", None, None, None),
    ),
    "the last word tells": (
        {"/cam": "rgb", "/semantic_camera/depth": "depth", "/depth_camera/semantic": "labels", "/info": "names"},
        ("/cam", "/semantic_camera/depth", None, "/depth_camera/semantic", None),
    ),
    "aligned depth before raw in the same frame": (
        {"/k/rgb/image": "rgb", "/k/depth/image": "depth", "/k/depth_registered/image": "depth"},
        ("/k/rgb/image", "/k/depth_registered/image", None, None, None),
    ),
    "thermal beside colour": (
        {"/thermal/image": "mono", "/front/image": "mono"}, ("/front/image", None, None, None, None),
    ),
    "a frame with and without the slash of ROS 1": (
        {"/cam/image": "rgb@/eye", "/a/camera_info": "info@other", "/b/camera_info": "info@eye"},
        ("/cam/image", None, None, None, "/b/camera_info"),
    ),
    "the calibration of a depth camera is not that of colour": (
        {"/cam/image": "rgb", "/depth/camera_info": "info@depth"}, ("/cam/image", None, None, None, None),
    ),
    "a calibration in the same frame serves whatever its name": (
        {"/cam/image": "rgb", "/depth/camera_info": "info"}, ("/cam/image", None, None, None, "/depth/camera_info"),
    ),
    "a calibration of each camera": (
        {
            "/color/image": "rgb", "/right/camera_info": "info", "/color/camera_info": "info",
            "/left/camera_info": "info",
        },
        ("/color/image", None, None, None, "/color/camera_info"),
    ),
    "odometry before stamped poses": (
        {"/cam": "rgb", "/odom": "odometry", "/pose": "pose"}, ("/cam", None, "/odom", None, None),
    ),
    "truth before odometry": (
        {"/cam": "rgb", "/odom": "odometry", "/ground_truth/pose": "pose"},
        ("/cam", None, "/ground_truth/pose", None, None),
    ),
    "colour before grey of one camera": (
        {"/k/qhd/image_color_rect": "rgb", "/k/qhd/image_mono_rect": "mono"},
        ("/k/qhd/image_color_rect", None, None, None, None),
    ),
    "colour before the mosaic it is made of": (
        {"/cam/image_raw": "bayer", "/cam/image_color": "rgb"}, ("/cam/image_color", None, None, None, None),
    ),
    "the mosaic before the grey that is made of it": (
        {"/cam/image_raw": "bayer", "/cam/image_rect": "mono"}, ("/cam/image_raw", None, None, None, None),
    ),
    "rectified before not": (
        {"/cam/image_rect": "rgb", "/cam/image_raw/compressed": "jpeg"}, ("/cam/image_rect", None, None, None, None),
    ),
    "an annotated picture is not the camera": (
        {"/cam/image_annotated": "jpeg", "/cam/image": "rgb"}, ("/cam/image", None, None, None, None),
    ),
    "an eye that is sent as rgb, too": (
        {
            "/zed/rgb/image_rect_color": "rgb@left", "/zed/left/image_rect_color": "rgb@left",
            "/zed/right/image_rect_color": "rgb@right", "/zed/rgb_raw/image_raw_color": "rgb@left",
        },
        ("/zed/rgb/image_rect_color", None, None, None, None),
    ),
    "transports of depth": (
        {
            "/cam": "rgb", "/d/image/compressed": "depth.png", "/d/image/compressedDepth": "depth.packed",
            "/d/image": "depth",
        },
        ("/cam", "/d/image", None, None, None),
    ),
    "transports of depth without raw": (
        {"/cam": "rgb", "/d/image/compressed": "depth.png", "/d/image/compressedDepth": "depth.packed"},
        ("/cam", "/d/image/compressedDepth", None, None, None),
    ),
    "labels of the own camera": (
        {
            "/front/rgb": "rgb@front", "/rear": "mono@rear", "/rear/semantic": "labels@rear",
            "/x_semantic": "labels@front", "/names": "names",
        },
        ("/front/rgb", None, None, "/x_semantic", None),
    ),
    "labels of an unknown frame": (
        {"/front/rgb": "rgb@front", "/rear/rgb": "mono@rear", "/gt/labels": "labels@odd", "/names": "names"},
        ("/front/rgb", None, None, "/gt/labels", None),
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


def test_what_is_asked_for_in_one_role_is_not_chosen_for_another(tmp_path: Path) -> None:
    """The only 16 bits are the labels that were asked for, and the only other picture of colours, too."""
    path = record(tmp_path / "log.mcap", {"/cam": "rgb", "/ids": "depth", "/painted": "rgb"})
    for asked, depth in (({"color": "/cam", "labels": "/ids"}, None), ({"labels": "/painted"}, "/ids")):
        with open_log([path], topics=asked) as log:
            choice = log.info.choice
            assert (choice.color, choice.depth, choice.labels) == ("/cam", depth, asked["labels"])
    with pytest.raises(ChannelError, match=r"^/cam was given for color and for labels; a channel can be only one"):
        open_log([path], topics={"color": "/cam", "labels": "/cam"})


def test_an_ambiguity_says_its_role_and_its_rivals(tmp_path: Path) -> None:
    with pytest.raises(ChannelError) as caught:
        open_log([record(tmp_path / "log.mcap", {"/left/image_raw": "rgb", "/right/image_raw": "rgb"})])
    assert (caught.value.role, caught.value.rivals) == ("color", ("/left/image_raw", "/right/image_raw"))
    with pytest.raises(ChannelError) as caught:
        open_log([record(tmp_path / "log.mcap", {"/cam": "rgb"})], topics={"depth": "/deph"})
    assert (caught.value.role, caught.value.rivals) == ("depth", ())


def test_a_topic_of_two_schemas_is_that_which_fits(tmp_path: Path) -> None:
    """The same topic as pose and as image: what was asked for picks the one that can play the role."""
    log = Recorder(tmp_path / "log.mcap")
    for i in range(3):
        stamp = BASE_NS + i * PERIOD_NS
        log.ros("/front", IMAGE, ROS.image(stamp, picture(i), "rgb8"), stamp)
        log.ros("/front", "geometry_msgs/msg/PoseStamped", ROS.pose(stamp, (float(i), 0, 0)), stamp)
    with open_log([log.close()], topics={"color": "/front", "pose": "/front"}) as opened:
        assert (opened.info.choice.color, opened.info.choice.pose) == ("/front", "/front")
        assert opened.frame(2, depth=False, previous=False).T_WC[0, 3] == 2


def test_each_image_channel_has_its_calibration() -> None:
    """Of colour, depth, infrared, and both sides of a stereo camera, each in a frame of its own."""
    names = ("color", "depth", "infra1", "left", "right")
    infos = [calibration(f"/cam/{name}/camera_info", f"{name}_optical") for name in names]
    for name in names:
        image = Candidate(calibration(f"/cam/{name}/image_raw", ""), Look("rgb", 8, "rgb8", f"{name}_optical"))
        assert choose_calibration(infos, image).topic == f"/cam/{name}/camera_info"
        without = Candidate(image.track, Look("rgb", 8, "rgb8", ""))
        assert choose_calibration(infos, without).topic == f"/cam/{name}/camera_info"
    right = Candidate(calibration("/cam/right/image_raw", ""), Look("rgb", 8, "rgb8", "right_optical"))
    assert choose_calibration(infos[:4], right).topic == "/cam/color/camera_info"
    assert choose_calibration(infos[1:4], right) is None


def test_equally_near_depth_channels_are_said(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap", {"/cam": "rgb", "/a/depth": "depth", "/b/depth": "depth"})
    with open_log([path]) as log:
        assert log.info.choice.depth == "/a/depth"
        assert log.info.warnings == (
            "/a/depth, /b/depth could all be the depth channel; /a/depth is used (--topic depth=TOPIC).",
        )  # fmt: skip
