"""Every message type in every family, against the encoders of others: what they write is what our readers read."""

from struct import error as struct_error
from typing import Any

import numpy as np
import pytest
from encoders_foxglove import Fox, Json
from encoders_ros import LEVEL, NS, Encoded, Link, RosMessages
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_logs import BASE_NS, picture

from stsem.camera import Camera
from stsem.log.schemas.messages import ClassNames, CompressedImage, Kind, RawImage, Transform
from stsem.log.schemas.table import TABLE, why_not

FAMILIES: dict[str, Any] = {
    "ros2": RosMessages(2),
    "ros2-big-endian": RosMessages(2, little_endian=False),
    "ros1": RosMessages(1),
    "protobuf": Fox(),
    "json": Json(),
}
ROS = ("ros2", "ros2-big-endian", "ros1")
FAMILY = st.sampled_from(sorted(FAMILIES))
TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)
STAMP = st.integers(1, (1 << 31) * NS - 1)
K = (500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0)
TURNED = (0.0, 0.0, 1.0, 0.0)
every_family = pytest.mark.parametrize("make", FAMILIES.values(), ids=FAMILIES)
every_ros = pytest.mark.parametrize("make", [FAMILIES[name] for name in ROS], ids=ROS)


def read(message: Encoded) -> Any:
    row = TABLE[message.encoding, message.schema]
    return row.reader(message.schema_record())(memoryview(message.payload))


def read_stamp(message: Encoded) -> int | None:
    row = TABLE[message.encoding, message.schema]
    assert row.stamp is not None
    return row.stamp(message.schema_record())(memoryview(message.payload))


@settings(derandomize=True, max_examples=150, deadline=None)
@given(
    family=FAMILY, stamp=STAMP, frame=TEXT, encoding=TEXT, height=st.integers(1, 5), width=st.integers(1, 5),
    padding=st.integers(0, 9),
)  # fmt: skip
def test_an_image_is_read_as_it_was_written(
    family: str, stamp: int, frame: str, encoding: str, height: int, width: int, padding: int
) -> None:
    """Whatever the texts' lengths do to the alignment."""
    pixels = picture(3, width, height)
    message = FAMILIES[family].image(stamp, pixels, encoding, frame_id=frame, padding=padding)
    got = read(message)
    assert isinstance(got, RawImage)
    assert (got.stamp_ns, got.frame_id, got.encoding) == (stamp, frame, encoding)
    assert (got.width, got.height, got.step, got.big_endian) == (width, height, width * 3 + padding, False)
    rows = np.frombuffer(got.data, np.uint8).reshape(height, got.step)
    assert (rows[:, : width * 3] == pixels.reshape(height, -1)).all()
    assert (rows[:, width * 3 :] == 77).all()
    assert read_stamp(message) == stamp


@settings(derandomize=True, max_examples=150, deadline=None)
@given(family=FAMILY, stamp=STAMP, frame=TEXT, form=TEXT, data=st.binary(max_size=50), video=st.booleans())
def test_a_compressed_image_and_a_video_are_read_as_they_were_written(
    family: str, stamp: int, frame: str, form: str, data: bytes, video: bool
) -> None:
    make = FAMILIES[family]
    message = (make.video if video else make.compressed)(stamp, data, form, frame)
    got = read(message)
    assert isinstance(got, CompressedImage)
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (stamp, frame, form, data)
    assert read_stamp(message) == stamp
    assert TABLE[message.encoding, message.schema].kind is (Kind.VIDEO if video else Kind.COMPRESSED)


@every_ros
def test_samples_of_either_byte_order_are_said(make: Any) -> None:
    depth = np.arange(6, dtype=">u2").reshape(2, 3)
    got = read(make.image(BASE_NS, depth, "16UC1"))
    assert got.big_endian
    assert (np.frombuffer(got.data, ">u2").reshape(2, 3) == depth).all()


@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "json"])
def test_pixels_are_a_view(family: str) -> None:
    """No copy of the pixels before they are converted."""
    message = FAMILIES[family].image(BASE_NS, picture(0), "rgb8")
    got = read(message)
    assert np.shares_memory(np.frombuffer(got.data, np.uint8), np.frombuffer(message.payload, np.uint8))


@every_family
def test_a_zero_stamp_is_no_stamp(make: Any) -> None:
    message = make.image(0, picture(0), "rgb8")
    assert read_stamp(message) is None
    assert read(message).stamp_ns is None


@every_family
def test_a_calibration_says_both_cameras(make: Any) -> None:
    p = (400.0, 0.0, 310.0, -40.0, 0.0, 401.0, 230.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    d = (0.1, -0.2, 0.001, 0.002, 0.3)
    got = read(make.camera_info(BASE_NS, 640, 480, K, "optical", d=d, model="plumb_bob", p=p))
    assert (got.stamp_ns, got.frame_id) == (BASE_NS, "optical")
    assert got.camera == Camera(640, 480, 500, 501, 320, 240, d, "plumb_bob")
    assert got.rectified == Camera(640, 480, 400, 401, 310, 230)
    bare = read(make.camera_info(BASE_NS, 640, 480, K, d=()))
    assert (bare.camera, bare.rectified) == (Camera(640, 480, 500, 501, 320, 240), None)
    assert read(make.camera_info(BASE_NS, 640, 480, (0.0,) * 9)).camera is None


@every_ros
def test_binning_and_region_of_interest_reach_the_camera(make: Any) -> None:
    got = read(make.camera_info(BASE_NS, 640, 480, K, binning=(2, 4), roi=(100, 40, 400, 200)))
    assert got.camera == Camera(200, 50, 250, 125.25, 109.75, 49.625)


@every_family
def test_transforms(make: Any) -> None:
    links: list[Link] = [("a", "b", (1.0, 2.0, 3.0), LEVEL), ("/b", "/c", (0.0, 0.5, 0.0), TURNED)]
    expected = (
        Transform(BASE_NS, "a", "b", (1.0, 2.0, 3.0), LEVEL),
        Transform(BASE_NS, "b", "c", (0.0, 0.5, 0.0), TURNED),
    )
    assert read(make.tf(BASE_NS, links)) == expected
    assert read(make.tf(BASE_NS, [])) == ()
    assert read(make.transform(BASE_NS, links[1])) == expected[1:]


@every_family
def test_poses(make: Any) -> None:
    assert read(make.pose(BASE_NS, (1, 2, 3), TURNED)) == (Transform(BASE_NS, "world", "", (1.0, 2.0, 3.0), TURNED),)
    odometry = read(make.odometry(BASE_NS, (1, 2, 3), TURNED, "odom", "base"))
    assert odometry == (Transform(BASE_NS, "odom", "base", (1.0, 2.0, 3.0), TURNED),)


@every_ros
def test_messages_that_only_ros_has(make: Any) -> None:
    pose = read(make.pose_with_covariance(BASE_NS, (1, 2, 3), TURNED))
    assert pose == (Transform(BASE_NS, "world", "", (1.0, 2.0, 3.0), TURNED),)
    old = read(make.tf(BASE_NS, [("a", "b", (1.0, 2.0, 3.0), LEVEL)], "tf/msg/tfMessage"))
    assert old == (Transform(BASE_NS, "a", "b", (1.0, 2.0, 3.0), LEVEL),)
    names = {0: "wall", 7: "Tür", 65535: ""}
    assert read(make.label_info(BASE_NS, names)) == ClassNames(BASE_NS, names)


SAMPLES = {
    f"{family}-{kind}": message
    for family, make in FAMILIES.items()
    for kind, message in {
        "image": make.image(BASE_NS, picture(0, 4, 3), "rgb8"),
        "compressed": make.compressed(BASE_NS, b"\xff\xd8\xff", "jpeg"),
        "calibration": make.camera_info(BASE_NS, 640, 480, K, d=(0.1,) * 5),
        "transforms": make.tf(BASE_NS, [("a", "b", (1.0, 2.0, 3.0), LEVEL)] * 2),
        "odometry": make.odometry(BASE_NS, (1, 2, 3)),
        **({"classes": make.label_info(BASE_NS, {0: "wall", 1: "floor"})} if family in ROS else {}),
    }.items()
}


@settings(derandomize=True, max_examples=1500, deadline=None)
@given(
    name=st.sampled_from(sorted(SAMPLES)), cut=st.integers(0, 10_000), at=st.integers(0, 10_000),
    bits=st.integers(0, 255),
)  # fmt: skip
def test_a_spoilt_message_is_an_error_of_a_known_kind(name: str, cut: int, at: int, bits: int) -> None:
    """Never another exception, and never more data than there is."""
    message = SAMPLES[name]
    payload = bytearray(message.payload)
    payload[at % len(payload)] ^= bits
    payload = payload[: cut % (len(payload) + 1)] if cut % 3 else payload
    spoilt = Encoded(message.schema, message.schema_encoding, message.definition, message.encoding, bytes(payload))
    try:
        got = read(spoilt)
    except (ValueError, struct_error, IndexError):
        return
    if isinstance(got, RawImage | CompressedImage):
        assert len(got.data) <= len(payload)
    elif isinstance(got, tuple):
        assert len(got) <= len(payload)


@every_family
def test_a_message_that_ends_early_is_never_read(make: Any) -> None:
    """At whatever byte it ends; a protobuf message may end behind any field."""
    message = make.odometry(BASE_NS, (1, 2, 3))
    if message.encoding == "protobuf":
        return
    for end in range(len(message.payload)):
        cut = Encoded(message.schema, message.schema_encoding, message.definition, message.encoding, b"")
        reader = TABLE[cut.encoding, cut.schema].reader(message.schema_record())
        with pytest.raises((ValueError, struct_error, IndexError)):
            reader(memoryview(message.payload)[:end])


def test_every_row_can_be_made_without_a_schema_text_or_says_why() -> None:
    """ROS and JSON types are standard; protobuf has no field numbers without its schema."""
    for (encoding, name), row in TABLE.items():
        schema = Encoded(name, "", b"", encoding, b"").schema_record()
        if encoding == "protobuf":
            with pytest.raises(ValueError, match="only 'protobuf'"):
                row.reader(schema)
        else:
            assert callable(row.reader(schema))
            assert row.stamp is None or callable(row.stamp(schema))


@pytest.mark.parametrize(
    ("encoding", "name", "reason"),
    [
        (
            "flatbuffer",
            "foxglove.RawImage",
            "messages in 'flatbuffer' are not read; record foxglove.RawImage as json or protobuf",
        ),
        (
            "json",
            "sensor_msgs/msg/Image",
            "messages in 'json' are not read; record sensor_msgs/msg/Image as cdr or ros1",
        ),
        ("flatbuffer", "my.Message", ""),
        ("protobuf", "foxglove.RawImage", ""),
    ],
)
def test_a_known_type_in_an_unknown_encoding_has_a_reason(encoding: str, name: str, reason: str) -> None:
    assert why_not(encoding, name) == reason
