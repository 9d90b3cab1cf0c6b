"""cdr against rosbags, protobuf against foxglove-sdk: what their encoders write is what our readers read."""

import struct
from typing import Any

import foxglove.messages as fox
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_logs import BASE_NS, LEVEL, NS, ROS, Link, picture
from mcap.records import Schema

from stsem.camera import Camera
from stsem.log.schemas import protobuf, ros2
from stsem.log.schemas.messages import Calibration, ClassNames, Transform
from stsem.log.schemas.table import TABLE

TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)
STAMP = st.integers(1, (1 << 31) * NS - 1)


def ros_schema(name: str) -> Schema:
    return Schema(id=1, name=name, encoding="ros2msg", data=ROS.schema(name))


def fox_schema(message: Any) -> Schema:
    schema = message.get_schema()
    return Schema(id=1, name=schema.name, encoding=schema.encoding, data=schema.data)


def fox_time(stamp_ns: int) -> Any:
    return fox.Timestamp(sec=stamp_ns // NS, nsec=stamp_ns % NS)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    stamp=STAMP, frame=TEXT, encoding=TEXT, height=st.integers(1, 5), width=st.integers(1, 5), padding=st.integers(0, 9)
)
def test_a_ros_image_is_read_as_it_was_written(
    stamp: int, frame: str, encoding: str, height: int, width: int, padding: int
) -> None:  # fmt: skip
    """Whatever the strings' lengths do to the alignment."""
    payload = ROS.image(stamp, picture(3, width, height), encoding, frame_id=frame, padding=padding)
    got = ros2.image(ros_schema("sensor_msgs/msg/Image"))(memoryview(payload))
    assert (got.stamp_ns, got.frame_id, got.encoding) == (stamp, frame, encoding)
    assert (got.width, got.height, got.step, got.big_endian) == (width, height, width * 3 + padding, False)
    assert len(got.data) == got.step * height
    assert ros2.header_stamp(memoryview(payload)) == stamp


@settings(derandomize=True, max_examples=60, deadline=None)
@given(stamp=STAMP, frame=TEXT, form=TEXT, data=st.binary(max_size=50))
def test_a_ros_compressed_image_is_read_as_it_was_written(stamp: int, frame: str, form: str, data: bytes) -> None:
    payload = ROS.compressed(stamp, data, form, frame)
    got = ros2.compressed_image(ros_schema("sensor_msgs/msg/CompressedImage"))(memoryview(payload))
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (stamp, frame, form, data)


def test_big_endian_cdr_is_read() -> None:
    """By hand, from the CDR rules: big endian marker, aligned numbers, strings with their zero."""
    body = struct.pack(">II", 5, 7) + struct.pack(">I", 3) + b"ab\0" + b"\0" + struct.pack(">I", 4) + b"png\0"
    payload = b"\0\0\0\0" + body + struct.pack(">I", 2) + b"xy"
    got = ros2.compressed_image(ros_schema("sensor_msgs/msg/CompressedImage"))(memoryview(payload))
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (5 * NS + 7, "ab", "png", b"xy")


@settings(derandomize=True, max_examples=200, deadline=None)
@given(cut=st.integers(0, 10_000), at=st.integers(0, 10_000), bits=st.integers(0, 255))
def test_a_spoilt_ros_image_is_an_error_of_a_known_kind(cut: int, at: int, bits: int) -> None:
    """Never another exception, and never more data than there is."""
    payload = bytearray(ROS.image(BASE_NS, picture(0, 4, 3), "rgb8"))
    payload[at % len(payload)] ^= bits
    payload = payload[: cut % (len(payload) + 1)]
    try:
        got = ros2.image(ros_schema("sensor_msgs/msg/Image"))(memoryview(payload))
    except (ValueError, struct.error, IndexError):
        return
    assert len(got.data) <= len(payload)


def test_a_zero_stamp_is_no_stamp() -> None:
    assert ros2.header_stamp(memoryview(ROS.image(0, picture(0), "rgb8"))) is None
    message = fox.RawImage(timestamp=fox_time(0), width=1, height=1, encoding="mono8", step=1, data=b"a")
    assert protobuf.stamp_reader(fox_schema(message))(memoryview(message.encode())) is None
    bare = fox.RawImage(width=1)
    assert protobuf.stamp_reader(fox_schema(bare))(memoryview(bare.encode())) is None


def test_camera_info() -> None:
    read = ros2.camera_info(ros_schema("sensor_msgs/msg/CameraInfo"))
    payload = ROS.camera_info(BASE_NS, 640, 480, [500, 0, 320, 0, 501, 240, 0, 0, 1], "optical")
    camera = Camera(640, 480, 500, 501, 320, 240)
    assert read(memoryview(payload)) == Calibration(BASE_NS, "optical", camera)
    uncalibrated = read(memoryview(ROS.camera_info(BASE_NS, 640, 480, [0] * 9)))
    assert uncalibrated.camera is None


def test_tf_and_poses_and_label_info() -> None:
    links: list[Link] = [("a", "/b", (1.0, 2.0, 3.0), LEVEL), ("b", "c", (0.0, 0.5, 0.0), (0.0, 0.0, 1.0, 0.0))]
    got = ros2.tf_message(ros_schema("tf2_msgs/msg/TFMessage"))(memoryview(ROS.tf(BASE_NS, links)))
    assert got == (
        Transform(BASE_NS, "a", "b", (1.0, 2.0, 3.0), LEVEL),
        Transform(BASE_NS, "b", "c", (0.0, 0.5, 0.0), (0.0, 0.0, 1.0, 0.0)),
    )
    pose = ros2.pose_stamped(ros_schema("geometry_msgs/msg/PoseStamped"))(memoryview(ROS.pose(BASE_NS, (1, 2, 3))))
    assert pose == (Transform(BASE_NS, "world", "", (1.0, 2.0, 3.0), LEVEL),)
    names = {0: "wall", 7: "Tür"}
    table = ros2.label_info(ros_schema("vision_msgs/msg/LabelInfo"))(memoryview(ROS.label_info(BASE_NS, names)))
    assert table == ClassNames(BASE_NS, names)


def test_a_namesake_with_other_fields_is_not_read() -> None:
    text = b"# comment\nint32 K=5\nstd_msgs/Header header # when\nstring format\n\nuint8[] data\n====\nMSG: a/B\n"
    name = "sensor_msgs/msg/CompressedImage"
    assert callable(ros2.compressed_image(Schema(id=1, name=name, encoding="ros2msg", data=text)))
    other = text.replace(b"string format", b"uint8 quality\nstring format")
    with pytest.raises(ValueError, match="its fields are header, quality, format, data, but header, format, data were"):
        ros2.compressed_image(Schema(id=1, name=name, encoding="ros2msg", data=other))


def test_a_schema_language_that_cannot_be_read_is_said() -> None:
    schema = Schema(id=1, name="tf2_msgs/msg/TFMessage", encoding="ros2idl", data=b"module tf2_msgs {}")
    with pytest.raises(ValueError, match="'ros2idl' cannot be read"):
        ros2.tf_message(schema)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    stamp=STAMP, frame=TEXT, encoding=TEXT, width=st.integers(0, 1 << 20), step=st.integers(0, 1 << 31),
    data=st.binary(max_size=300),
)  # fmt: skip
def test_a_foxglove_image_is_read_as_it_was_written(
    stamp: int, frame: str, encoding: str, width: int, step: int, data: bytes
) -> None:  # fmt: skip
    message = fox.RawImage(
        timestamp=fox_time(stamp), frame_id=frame, width=width, height=3, encoding=encoding, step=step, data=data
    )
    payload = memoryview(message.encode())
    got = protobuf.raw_image(fox_schema(message))(payload)
    assert (got.stamp_ns, got.frame_id, got.encoding, bytes(got.data)) == (stamp, frame, encoding, data)
    assert (got.width, got.height, got.step, got.big_endian) == (width, 3, step, False)
    assert protobuf.stamp_reader(fox_schema(message))(payload) == stamp


def test_foxglove_compressed_image_calibration_and_pose() -> None:
    when = fox_time(BASE_NS)
    image = fox.CompressedImage(timestamp=when, frame_id="cam", data=b"\xff\xd8", format="jpeg")
    got = protobuf.compressed_image(fox_schema(image))(memoryview(image.encode()))
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (BASE_NS, "cam", "jpeg", b"\xff\xd8")
    k = [500, 0, 320, 0, 501, 240, 0, 0, 1]
    calibration = fox.CameraCalibration(timestamp=when, frame_id="cam", width=640, height=480, K=k)
    read = protobuf.camera_calibration(fox_schema(calibration))
    assert read(memoryview(calibration.encode())) == Calibration(BASE_NS, "cam", Camera(640, 480, 500, 501, 320, 240))
    pose = fox.PoseInFrame(
        timestamp=when, frame_id="world",
        pose=fox.Pose(position=fox.Vector3(x=1, y=2, z=3), orientation=fox.Quaternion(x=0, y=0, z=0, w=1)),
    )  # fmt: skip
    assert protobuf.pose_in_frame(fox_schema(pose))(memoryview(pose.encode())) == (
        Transform(BASE_NS, "world", "", (1.0, 2.0, 3.0), LEVEL),
    )


def test_fields_nobody_knows_are_passed_over() -> None:
    """Wire types 0, 1, 2 and 5 with field numbers of a newer schema, before and behind the known ones."""
    message = fox.CompressedImage(timestamp=fox_time(BASE_NS), frame_id="cam", data=b"abc", format="png")
    strange = b"\xf8\x3f\x96\x01" + b"\xf9\x3f" + bytes(8) + b"\xfa\x3f\x02hi" + b"\xfd\x3f" + bytes(4)
    got = protobuf.compressed_image(fox_schema(message))(memoryview(strange + message.encode() + strange))
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (BASE_NS, "cam", "png", b"abc")


@pytest.mark.parametrize(
    "payload", [b"\x0a\x7fabc", b"\x0b", b"\xff" * 11, b"\x0a\x02\x08", b"\x12\x01\xff", b"\x08\x01"]
)
def test_a_spoilt_foxglove_message_is_an_error_of_a_known_kind(payload: bytes) -> None:
    read = protobuf.compressed_image(fox_schema(fox.CompressedImage()))
    try:
        got = read(memoryview(payload))
    except (ValueError, IndexError):
        return
    assert len(got.data) <= len(payload)


def test_every_row_of_the_table_can_be_made_from_its_schema() -> None:
    """No row names a schema that its reader cannot read."""
    for (encoding, name), row in TABLE.items():
        if encoding == "cdr":
            schema = ros_schema(name)
        else:
            video = name == "foxglove.CompressedVideo"
            message = fox.CompressedVideo() if video else getattr(fox, name.split(".")[1])()
            schema = fox_schema(message)
        assert callable(row.reader(schema))
        assert row.stamp is None or callable(row.stamp(schema))


def test_numpy_data_of_a_ros_image_are_a_view() -> None:
    """No copy of the pixels before they are converted."""
    payload = memoryview(ROS.image(BASE_NS, picture(0), "rgb8"))
    data = ros2.image(ros_schema("sensor_msgs/msg/Image"))(payload).data
    assert np.shares_memory(np.frombuffer(data, np.uint8), np.frombuffer(payload, np.uint8))
