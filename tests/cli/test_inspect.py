"""`stsem inspect`, as typed: the text, the JSON, what is shown of logs that cannot be opened, exit codes."""

import json
import shlex
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from stsem.cli.columns import channel_table
from stsem.log.info import ChannelInfo

sys.path.insert(0, str(Path(__file__).parents[1] / "log"))

from made_up_logs import BASE_NS, ROS, Recorder, label_picture, picture, room
from robots import Robot

from .conftest import Cli

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
TEXT = """\
log: 0.1 MB, 2.3 s, profile ros2, written by test
sha256 {sha256}

topic                   type        encoding    content      messages     Hz    gap s     delay ms  used as
----------------------  ----------  ----------  ---------  ----------  -----  -------  -----------  -----------
/cam/color/camera_info  CameraInfo  cdr         –                  24  10.00    0.100    4.0 / 4.0  calibration
/cam/color/image_raw    Image       cdr         rgb8               24  10.00    0.100    5.0 / 5.0  color
/cam/depth/image_raw    Image       cdr         16UC1              24  10.00    0.100    6.0 / 6.0  depth
/gt/label_info          LabelInfo   cdr         –                   1      –        –    0.0 / 0.0  classes
/gt/labels              Image       cdr         mono8              24  10.00    0.100  20.0 / 20.0  labels
/tf                     TFMessage   cdr         –                  50  20.00    0.050    2.0 / 2.0  tf
/tf_static              TFMessage   cdr         –                   1      –        –    0.0 / 0.0  tf_static
(schemas are shortened to fit 120 columns; --json has all)

for          would be used           because
-----------  ----------------------  -------------------
color        /cam/color/image_raw    only one
depth        /cam/depth/image_raw    only one
pose         /tf                     chain of transforms
labels       /gt/labels              only one
calibration  /cam/color/camera_info  belongs to color

Frames:  24 of 32x24 every 100.0 ms; with depth 24 (100%), with a pose 24 (100%), with truth 24 (100%)
Camera:  fx 30 fy 30 cx 15.5 cy 11.5 px; sees 56.1 x 43.6 degrees; lens distortion: none
Depth:   16UC1; pixels are those of color; 1 % 1.00 m, 5 % 1.00 m, 50 % 1.01 m, 95 % 1.02 m, 99 % 1.02 m; 0.3% unknown
         in 24 frames looked at
Pose:    world -> base -> camera; 50 samples, path of 0.49 m, largest gap 50 ms
Clocks:  color is logged 5.0 ms behind its stamp or later; nothing taken out

Truth:   3 classes in 24 frames looked at; 4.17% of the pixels ignored
  id  class      pixels    share of labelled
----  -------  --------  -------------------
   0  wall         5888               33.33%
   1  floor        5888               33.33%
   2  door         5888               33.33%

Ready: stsem-replay log.mcap
"""


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")


def two_cameras(path: Path) -> Path:
    log = Recorder(path)
    for topic in ("/left/image", "/right/image"):
        log.ros(topic, IMAGE, ROS.image(BASE_NS, picture(0), "rgb8"), BASE_NS)
    return log.close()


def spoilt_images(path: Path) -> Path:
    log = Recorder(path)
    log.ros("/cam", COMPRESSED, ROS.compressed(BASE_NS, b"\xff\xd8\xff\xe0nothing", "jpeg"), BASE_NS)
    return log.close()


@pytest.mark.usefixtures("wide")
def test_the_whole_text(cli: Cli, home: Path) -> None:
    Robot().record(home / "log.mcap")
    ran = cli("inspect", "log.mcap")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == TEXT.format(sha256=json.loads(cli("inspect", "log.mcap", "--json").out)["log"]["sha256"])


@pytest.mark.usefixtures("wide")
def test_findings_are_numbered_and_the_command_is_what_was_asked_for(cli: Cli, home: Path) -> None:
    Robot(labels=lambda i: None, depth=lambda i: np.zeros((24, 32), "<u2")).record(home / "my log.mcap")
    ran = cli("inspect", "my log.mcap", "--topic", "color=/cam/color/image_raw", "--depth-registered", "yes")
    assert ran.code == 0
    assert " 1. depth-unknown: 100% of the pixels of /cam/depth/image_raw have no depth.\n" in ran.out
    assert "\n    do: Check range, light" in ran.out
    assert " 2. truth-missing: The log has no label images" in ran.out
    verdict = ran.out.splitlines()[-1]
    assert verdict.startswith("Usable with 2 findings: ")
    assert shlex.split(verdict.partition(": ")[2]) == [
        "stsem-replay", "my log.mcap", "--topic", "color=/cam/color/image_raw", "--depth-registered", "yes",
    ]  # fmt: skip


@pytest.mark.usefixtures("wide")
@pytest.mark.parametrize(
    ("make", "arguments", "code", "verdict", "sentence"),
    [
        (two_cameras, [], 1, "no clear choice for color", "2 cameras could be the colour camera"),
        (two_cameras, ["--topic", "color=/nope"], 1, "no channel for color", "no topic '/nope'"),
        (two_cameras, ["--topic", "color=/left/image", "--classes", "no.json"], 1, "the class table", "no.json"),
        (spoilt_images, [], 5, "no colour image can be decoded", "No image of /cam can be decoded"),
    ],
    ids=["two cameras", "no such topic", "class table", "spoilt"],
)
def test_the_table_comes_before_the_sentence(
    cli: Cli, home: Path, make, arguments: list[str], code: int, verdict: str, sentence: str
) -> None:
    path = make(home / "log.mcap")
    ran = cli("inspect", path, *arguments)
    assert ran.code == code
    assert sentence in ran.sentence
    assert ran.out.startswith("topic")
    assert ran.out.endswith(f"\nNot usable as it is: {verdict}.\n")
    ran = cli("inspect", path, *arguments, "--json")
    found = json.loads(ran.out)
    assert ran.code == code
    assert found["error"] == ran.sentence
    assert [channel["count"] for channel in found["channels"]] == [1] * len(found["channels"])


def test_damage_is_shown_before_the_choice(cli: Cli, home: Path) -> None:
    path = two_cameras(home / "log.mcap")
    path.write_bytes(path.read_bytes()[:-8])
    ran = cli("inspect", path)
    assert ran.code == 1
    assert "Damage: truncated 1" in ran.out


def test_json_is_canonical_and_the_same_each_time(cli: Cli, home: Path) -> None:
    room(home / "log.mcap")
    one, other = cli("inspect", "log.mcap", "--json").out, cli("inspect", "log.mcap", "--json").out
    assert one == other
    assert one == json.dumps(json.loads(one), sort_keys=True, indent=2, ensure_ascii=False) + "\n"
    assert json.loads(one)["findings"] == []


def channel(topic: str) -> ChannelInfo:
    return ChannelInfo(
        topic, "sensor_msgs/msg/CompressedImage", "cdr", 1000, 10.0, 0, 1, 5, 6, 7, 0, 0.1, "jpeg", "color", "color"
    )


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
@pytest.mark.parametrize("length", [4, 40, 120])
def test_tables_fit(width: int, length: int) -> None:
    """And it is said what was done to make them fit."""
    topic = "/" + "x" * (length - 4) + "end"
    table = channel_table([channel(topic)], width)
    assert max(map(len, table.splitlines()[:3])) <= width
    assert "end" in table
    shown_whole = topic in table and "sensor_msgs/msg/CompressedImage" in table and "cdr" in table
    assert ("--json has all" in table) == (not shown_whole)


def test_hostile_names_stay_on_their_lines(cli: Cli, home: Path) -> None:
    names = {0: "wall\n\x1b[31m", 1: "\u202efloor", 2: "x" * 4000}
    Robot(tables=(names,)).record(home / "log.mcap")
    ran = cli("inspect", "log.mcap")
    assert ran.code == 0
    assert all(line.isprintable() for line in ran.out.splitlines())
    assert max(map(len, ran.out.splitlines())) < 200


def test_what_can_be_converted_is_said(cli: Cli, home: Path) -> None:
    (home / "drive.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    ran = cli("inspect", "drive.bag")
    assert (ran.code, ran.out) == (1, "")
    assert "ROS 1 bag" in ran.sentence
    assert ran.sentence.endswith("stsem convert drive.bag")
    (home / "images").mkdir()
    cv2.imwrite(str(home / "images" / "0.png"), np.repeat(label_picture(0)[:, :, None], 3, axis=2))
    assert cli("inspect", "images").sentence.endswith("stsem convert images")
    (home / "text").write_text("nothing")
    assert "convert" not in cli("inspect", "text").sentence


def test_a_damaged_log_is_inspected_as_far_as_it_goes(cli: Cli, home: Path) -> None:
    path = room(home / "log.mcap")
    path.write_bytes(path.read_bytes()[:-8])
    ran = cli("inspect", path)
    assert ran.code == 3
    assert " 1. damage: The log is damaged: truncated 1" in ran.out


def test_the_replay_says_so_too(cli: Cli, home: Path) -> None:
    (home / "drive.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    assert cli("replay", "drive.bag").sentence.endswith("stsem convert drive.bag")


def test_a_log_given_twice(cli: Cli, tiny_log: Path) -> None:
    """As in a replay: the command that is shown at the end could not be."""
    ran = cli("inspect", tiny_log, tiny_log)
    assert (ran.code, ran.out) == (2, "")
    assert ran.sentence == f"{tiny_log} was given twice; give each log once."
