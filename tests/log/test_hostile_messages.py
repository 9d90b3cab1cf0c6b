"""Messages and schemas made to cost memory or time, or to be taken for something else."""

import base64
import struct
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest
from encoders_foxglove import Fox, Json, fox_time
from encoders_ros import LEVEL, NS, Encoded, RosMessages
from foxglove.messages import CompressedImage as SdkImage
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from made_up_logs import BASE_NS, picture
from mcap.records import Schema

from stsem.log.container.damage import Damage
from stsem.log.schemas import foxglove_json, protobuf
from stsem.log.schemas.cursor import ROS1, Cursor, cdr
from stsem.log.schemas.messages import Kind, Transform
from stsem.log.schemas.table import TABLE
from stsem.log.tracks import MAX_DIFFERENT, Track

K = (500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0)
LITTLE = b"\0\1\0\0"
HUGE = struct.pack("<I", 0xFFFFFFFF)
NO_HEADER = bytes(12)


def read(encoding: str, name: str, payload: bytes, schema: Schema | None = None) -> Any:
    schema = schema or Schema(id=1, name=name, encoding="", data=b"")
    return TABLE[encoding, name].reader(schema)(memoryview(payload))


def peak_bytes(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("tf2_msgs/msg/TFMessage", HUGE + bytes(80)),
        ("sensor_msgs/msg/CompressedImage", NO_HEADER + HUGE + bytes(80)),
        ("sensor_msgs/msg/CompressedImage", NO_HEADER + struct.pack("<I", 4) + b"png\0" + HUGE + bytes(80)),
        ("sensor_msgs/msg/CameraInfo", NO_HEADER + bytes(12) + HUGE + bytes(300)),
        ("vision_msgs/msg/LabelInfo", NO_HEADER + HUGE + bytes(80)),
    ],
)
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_announced_lengths_are_never_allocated(encoding: str, name: str, body: bytes) -> None:
    front = LITTLE if encoding == "cdr" else b"" if "TFMessage" in name else bytes(4)

    def work() -> None:
        with pytest.raises(ValueError, match=r"4294967295 (bytes|numbers|items) are announced but"):
            read(encoding, name, front + body)

    assert peak_bytes(work) < 1 << 20


def test_a_name_of_megabytes_is_refused() -> None:
    body = NO_HEADER[:8] + struct.pack("<I", 1 << 20) + b"a" * (1 << 20)
    with pytest.raises(ValueError, match="a name of 1048576 bytes"):
        read("cdr", "sensor_msgs/msg/Image", LITTLE + body)
    with pytest.raises(ValueError, match="frame_id has 1048576 characters"):
        read("json", "foxglove.RawImage", b'{"frame_id": "' + b"a" * (1 << 20) + b'"}')
    message = Fox().compressed(BASE_NS, b"", "jpeg", "a" * (1 << 20))
    with pytest.raises(ValueError, match="frame_id has 1048576 bytes"):
        read("protobuf", "foxglove.CompressedImage", message.payload, message.schema_record())


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"[" * 1_000_000, "1000000 values"),
        (b"[" * 50_000, "nested too deeply"),
        (b'{"a":' * 40_000, "nested too deeply"),
        (b"[" + b"[]," * 1_000_000 + b"[]]", "values"),
        (b"[1, 2]", "a list came where an object was expected"),
        (b"", "Expecting value"),
        (b"\xff\xfe{}", "."),
        (b'{"timestamp": 7}', "timestamp is not a message"),
        (b'{"timestamp": {"sec": "7"}}', "sec is not a whole number of 64 bits"),
        (b'{"timestamp": {"sec": 7.5}}', "sec is not a whole number of 64 bits"),
        (b'{"timestamp": {"sec": true}}', "sec is not a whole number of 64 bits"),
        (b'{"timestamp": {"sec": 1' + b"0" * 400 + b"}}", "sec is not a whole number of 64 bits"),
        (b'{"timestamp": {"sec": ' + b"9" * 1_000_000 + b"}}", "Exceeds the limit"),
        (b'{"timestamp": {"sec": 1e999}}', "sec is not a whole number of 64 bits"),
        (b'{"width": -1}', "width is -1, which is no size"),
        (b'{"width": 4294967296}', "which is no size"),
        (b'{"encoding": 5}', "encoding is not a text"),
        (b'{"data": "a*b="}', "base64"),
        (b'{"data": "abc"}', "padding"),
        (b'{"data": [1, 2]}', "data is not bytes or base64"),
    ],
)
def test_json_that_is_no_image_is_refused(text: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        read("json", "foxglove.RawImage", text)


@pytest.mark.parametrize("value", [b'"500"', b"[true]", b'["a"]', b"[[1]]", b"{}1", b"5", b"[1" + b"0" * 400 + b"]"])
def test_json_numbers_that_are_none_are_refused(value: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        read("json", "foxglove.CameraCalibration", b'{"K": ' + value + b"}")


def test_times_of_json_may_be_written_in_other_ways() -> None:
    """As whole floats, as seconds and nanos, and between other white space."""
    pose = b'{"timestamp":\n{"sec": 5.0, "nsec":\t7} , "frame_id": "w"}'
    assert read("json", "foxglove.PoseInFrame", pose)[0].stamp_ns == 5 * NS + 7
    pose = b'{"timestamp": {"seconds": 5, "nanos": 7}}'
    assert read("json", "foxglove.PoseInFrame", pose)[0].stamp_ns == 5 * NS + 7


@pytest.mark.parametrize(
    "text",
    [
        b'{"timestamp": {"sec": 5, "nsec": 7}, "data": "%s"}',
        b'{"data" : "%s" ,"timestamp": {"sec": 5, "nsec": 7}}',
        b'{"data": "%s\\/", "timestamp": {"sec": 5, "nsec": 7}}',
        b'{"data": "%s\\"", "timestamp": {"sec": 5, "nsec": 7}}',
        b'{"frame_id": "data", "timestamp": {"sec": 5, "nsec": 7}, "data": "%s"}',
        b'{"frame_id": "\\"data\\": \\"", "timestamp": {"sec": 5, "nsec": 7}, "data": "%s"}',
    ],
)
def test_the_stamp_of_a_json_image_is_found_beside_its_pixels(text: bytes) -> None:
    stamp = foxglove_json.stamp_reader(Schema(id=1, name="", encoding="", data=b""))
    assert stamp(memoryview(text.replace(b"%s", base64.b64encode(bytes(300))))) == 5 * NS + 7


def described(change: Callable[[FileDescriptorSet], None]) -> Schema:
    """The schema of foxglove.CompressedImage, changed."""
    schema = SdkImage().get_schema()
    found = FileDescriptorSet.FromString(schema.data)
    change(found)
    return Schema(id=1, name=schema.name, encoding="protobuf", data=found.SerializeToString())


def field(files: FileDescriptorSet, name: str) -> Any:
    (message,) = (m for file in files.file for m in file.message_type if m.name == "CompressedImage")
    (found,) = (f for f in message.field if f.name == name)
    return found


def test_field_numbers_are_those_of_the_schema_in_the_file() -> None:
    def renumber(files: FileDescriptorSet) -> None:
        field(files, "frame_id").number = 90

    message = SdkImage(timestamp=fox_time(BASE_NS), frame_id="cam", data=b"abc", format="png").encode()
    got = read("protobuf", "foxglove.CompressedImage", message + b"\xd2\x05\x03odd", described(renumber))
    assert (got.stamp_ns, got.frame_id, bytes(got.data)) == (BASE_NS, "odd", b"abc")


def test_fields_nobody_knows_are_passed_over() -> None:
    """Wire types 0, 1, 2 and 5 with field numbers of a newer schema, before and behind the known ones."""
    message = Fox().compressed(BASE_NS, b"abc", "png", "cam")
    strange = b"\xf8\x3f\x96\x01" + b"\xf9\x3f" + bytes(8) + b"\xfa\x3f\x02hi" + b"\xfd\x3f" + bytes(4)
    got = read("protobuf", message.schema, strange + message.payload + strange, message.schema_record())
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (BASE_NS, "cam", "png", b"abc")


def test_a_protobuf_type_that_contains_itself_costs_nothing() -> None:
    """However deep a message of it is."""

    def loop(files: FileDescriptorSet) -> None:
        timestamp = field(files, "timestamp")
        timestamp.type_name = ".foxglove.CompressedImage"

    deep = b""
    for _ in range(40):
        deep = b"\x0a" + bytes([len(deep)]) + deep if len(deep) < 128 else deep
    schema = described(loop)
    with pytest.raises(ValueError, match="nested too deeply"):
        read("protobuf", "foxglove.CompressedImage", deep, schema)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\xff" * 50, "no set of protobuf descriptors"),
        (b"", "does not describe foxglove.CompressedImage"),
        (bytes((1 << 20) + 1), "more than any message definition"),
    ],
)
def test_a_schema_that_is_no_set_of_descriptors_is_refused(data: bytes, reason: str) -> None:
    schema = Schema(id=1, name="foxglove.CompressedImage", encoding="protobuf", data=data)
    with pytest.raises(ValueError, match=reason):
        protobuf.Messages(schema)


def test_a_type_of_thousands_of_fields_is_refused() -> None:
    def grow(files: FileDescriptorSet) -> None:
        (message,) = (m for file in files.file for m in file.message_type if m.name == "CompressedImage")
        for number in range(1000, 3000):
            message.field.add(name=f"f{number}", number=number, type="TYPE_STRING", label="LABEL_OPTIONAL")

    with pytest.raises(ValueError, match=r"foxglove.CompressedImage is described with 2004 fields"):
        read("protobuf", "foxglove.CompressedImage", b"", described(grow))


def test_a_schema_without_the_types_below_is_refused_when_they_are_met() -> None:
    def forget(files: FileDescriptorSet) -> None:
        kept = [file for file in files.file if file.package == "foxglove"]
        del files.file[:]
        files.file.extend(kept)

    message = Fox().compressed(BASE_NS, b"abc", "png")
    with pytest.raises(ValueError, match=r"google.protobuf.Timestamp is not described"):
        read("protobuf", message.schema, message.payload, described(forget))


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"\x0a\x7fabc", "127 bytes are announced but 3 are there"),
        (b"\x0b", "wire type 3 is unknown"),
        (b"\xff" * 11, "longer than 10 bytes"),
        (b"\x08\x01", "timestamp is of wire type 0 instead of 2"),
        (b"\xf8\x3f\x01" * 200_000, "more than 100000 fields"),
        (b"\x22\x01\xff", "utf-8"),
    ],
)
def test_bytes_that_are_no_protobuf_image_are_refused(payload: bytes, reason: str) -> None:
    schema = Fox().compressed(BASE_NS, b"", "").schema_record()
    with pytest.raises(ValueError, match=reason):
        read("protobuf", "foxglove.CompressedImage", payload, schema)


def test_numbers_may_be_packed_or_not() -> None:
    message = Fox().camera_info(BASE_NS, 640, 480, K)
    packed = struct.pack("<9d", *K)
    assert packed in message.payload
    single = b"".join(b"\x31" + struct.pack("<d", value) for value in K)
    loose = message.payload.replace(b"\x32\x48" + packed, single)
    assert loose != message.payload
    both = [read("protobuf", message.schema, data, message.schema_record()) for data in (message.payload, loose)]
    assert both[0] == both[1]
    assert both[0].camera is not None


def test_big_endian_cdr_by_hand() -> None:
    """From the CDR rules: big endian marker, aligned numbers, strings with their zero."""
    body = struct.pack(">II", 5, 7) + struct.pack(">I", 3) + b"ab\0" + b"\0" + struct.pack(">I", 4) + b"png\0"
    got = read("cdr", "sensor_msgs/msg/CompressedImage", b"\0\0\0\0" + body + struct.pack(">I", 2) + b"xy")
    assert (got.stamp_ns, got.frame_id, got.format, bytes(got.data)) == (5 * NS + 7, "ab", "png", b"xy")


@pytest.mark.parametrize(("front", "order"), [(b"\0\6\0\0", ">"), (b"\0\7\0\0", "<")])
def test_plain_xcdr2_by_hand(front: bytes, order: str) -> None:
    """Numbers of 8 bytes are aligned to 4, and a sequence of messages begins with its size (XTypes 1.3, 7.4.3.5)."""
    one = struct.pack(order + "III2sxx", 5, 7, 2, b"w\0") + struct.pack(order + "I2sxx", 2, b"b\0")
    one += struct.pack(order + "7d", 1, 2, 3, *LEVEL)
    body = struct.pack(order + "II", 4 + len(one), 1) + one
    expected = Transform(5 * NS + 7, "w", "b", (1.0, 2.0, 3.0), LEVEL)
    assert read("cdr", "tf2_msgs/msg/TFMessage", front + body) == (expected,)
    assert read("cdr", "geometry_msgs/msg/TransformStamped", front + one) == (expected,)


@pytest.mark.parametrize("front", [b"", b"\0\1", b"\0\2\0\0", b"\0\3\0\0", b"\0\x09\0\0", b"\0\x0b\0\0", b"\1\1\0\0"])
def test_other_encapsulations_are_refused(front: bytes) -> None:
    with pytest.raises(ValueError, match="does not begin as plain cdr but with"):
        cdr(memoryview(front + bytes(60) if len(front) > 2 else front))


def test_a_cursor_walks_past_no_end() -> None:
    cursor = Cursor(memoryview(b"\1"), ROS1)
    assert cursor.u8() == 1
    with pytest.raises(IndexError):
        cursor.u8()
    for step in (cursor.u16, cursor.u32, cursor.stamp, cursor.blob):
        with pytest.raises(struct.error):
            step()


@pytest.mark.parametrize("spelling", ["sensor_msgs/msg/Image", "sensor_msgs/Image", "sensor_msgs::msg::dds_::Image_"])
def test_a_type_is_known_by_its_names_in_ros_2_ros_1_and_dds(spelling: str) -> None:
    message = RosMessages(2).image(BASE_NS, picture(0), "rgb8")
    schema = Schema(id=1, name=spelling, encoding="ros2idl", data=b"module sensor_msgs {}")
    assert read("cdr", spelling, message.payload, schema).stamp_ns == BASE_NS


def track(message: Encoded) -> Track:
    return Track("/topic", message.schema_record(), message.encoding, Damage())


def fed(made: Track, *messages: Encoded) -> Track:
    for i, message in enumerate(messages):
        made.add(memoryview(message.payload), BASE_NS + i, 0, 0)
    return made


@pytest.mark.parametrize("make", [RosMessages(2), RosMessages(2, False), RosMessages(1), Fox(), Json()])
def test_a_track_keeps_calibrations_that_differ(make: Any) -> None:
    """Also where only the rectified camera does; equal ones with later stamps are one."""
    p = (400.0, 0, 310, 0, 0, 401, 230, 0, 0, 0, 1, 0)
    infos = [make.camera_info(BASE_NS + i, 640, 480, K) for i in range(3)]
    later = [make.camera_info(BASE_NS + i, 640, 480, K, p=p) for i in range(3, 6)]
    got = fed(track(infos[0]), *infos, *later)
    assert got.kind is Kind.CALIBRATION
    assert [c.stamp_ns for c in got.calibrations] == [BASE_NS, BASE_NS + 3]
    assert [c.rectified is None for c in got.calibrations] == [True, False]


def test_a_track_keeps_few_calibrations_of_many() -> None:
    """A camera that focuses by itself: the first ones and the last, and how often it changed."""
    make = RosMessages(2)
    infos = [make.camera_info(BASE_NS + i, 640, 480, (400.0 + i, *K[1:])) for i in range(MAX_DIFFERENT + 10)]
    got = fed(track(infos[0]), *infos)
    kept = [*range(MAX_DIFFERENT - 1), MAX_DIFFERENT + 9]
    assert [c.camera.fx for c in got.calibrations if c.camera] == [400.0 + i for i in kept]
    assert got.changes == MAX_DIFFERENT + 9


def test_frames_without_end_are_damage(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stsem.log.tracks.MAX_PAIRS", 4)
    make = RosMessages(2)
    messages = [make.tf(BASE_NS, [("world", f"{i}{j}", (0.0, 0.0, 0.0), LEVEL) for j in range(2)]) for i in range(5)]
    damage = Damage()
    got = Track("/tf", messages[0].schema_record(), "cdr", damage)
    fed(got, *messages[:3], messages[0])
    assert len(got.transforms) == 4
    assert {len(samples) for samples in got.transforms.values()} == {1, 2}
    assert damage.counts == {"undecodable": {"/tf": 1}}
    assert damage.reasons["/tf"].startswith("there are more than")


def test_a_message_without_transforms_lacks_no_stamp() -> None:
    empty = RosMessages(2).tf(BASE_NS, [])
    got = fed(track(empty), empty)
    assert (got.count, got.unstamped, got.transforms) == (1, 0, {})


def test_a_track_says_why_a_known_type_is_not_read() -> None:
    image = Encoded("foxglove.RawImage", "flatbuffer", b"bfbs", "flatbuffer", b"x")
    got = fed(track(image), image)
    assert (got.kind, got.count) == (None, 1)
    assert got.trouble == "/topic: messages in 'flatbuffer' are not read; record foxglove.RawImage as json or protobuf"
    foreign = Encoded("my.Message", "flatbuffer", b"bfbs", "flatbuffer", b"x")
    assert fed(track(foreign), foreign).trouble == ""
