"""Files, topics, frames and classes may be called anything: nothing is interpreted, and nothing lands elsewhere."""

import json
import os
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove import messages as fox
from mcap.writer import Writer

from tests.made_up_walk import write_walk

from .conftest import Cli, report, rows

NAMES = (
    "[red]x[/red][/]", "\x1b[31mx\x1b]0;title\x07", "two\nlines", "<script>alert(1)</script>", "a|b", "-rf",
    "![x](http://h)", "$\\frac$ ${HOME} `id`", "Küche 厨房", "\u202eevil", "x" * 250, "..", ".hidden", "a`b",
    "\udc80\udcff", "&lt;", "'\"",
)  # fmt: skip


@pytest.fixture(scope="module")
def short_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_walk(tmp_path_factory.mktemp("short") / "short.mcap", frames=2)


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_files(replay: Cli, cli: Cli, home: Path, short_log: Path, name: str) -> None:
    """Replayed into the default place: a folder right below reports/, named after the file."""
    folder = home / "in"
    folder.mkdir()
    path = folder / f"{name.replace('/', '')}.mcap"
    os.symlink(short_log, path)
    before = {p for p in home.parent.rglob("*") if "cache" not in p.parts}
    ran = replay("--clock", "offline", "--model", "oracle", "--mode", "keyframe", path)
    assert ran.code == 0, ran.err
    assert_fit_to_show(ran.out + ran.err)
    made = {p for p in home.parent.rglob("*") if "cache" not in p.parts} - before
    (written,) = {p.parent for p in made if p.name == "report.json"}
    assert written.parent.parent == home / "reports"
    assert all(home / "reports" in (p, *p.parents) for p in made)
    assert_report_is_harmless(written)
    inspected = cli("inspect", path, "--json")
    assert inspected.code == 0, inspected.err
    assert len(json.loads(inspected.out)["log"]["files"]) == 1


def test_arguments(cli: Cli, home: Path) -> None:
    """In a sentence about a file that is not there, and in one about two logs of the same name."""
    for name in NAMES:
        ran = cli("inspect", "--", home / name / "x.mcap")
        assert ran.code == 1
        assert_fit_to_show(ran.sentence)


@pytest.mark.parametrize("name", [*NAMES, "x" * 100_000], ids=range(len(NAMES) + 1))
def test_topics_frames_and_classes(replay: Cli, cli: Cli, home: Path, name: str) -> None:
    """The same names inside a log, through inspect and replay."""
    if "\udc80" in name:
        pytest.skip("cannot stand in a record: it is no UTF-8")
    named(home / "log.mcap", name)
    inspected = cli("inspect", "log.mcap")
    assert inspected.code == 0, inspected.err
    assert_fit_to_show(inspected.out + inspected.err)
    ran = replay("log.mcap", "--model", "oracle", "--mode", "keyframe", "--out", "r")
    assert ran.code == 0, ran.err
    assert_fit_to_show(ran.out + ran.err)
    assert_report_is_harmless(home / "r")
    document = report("r")
    shown = document["input"]["logs"][0]["channels"]["color"]["topic"]
    assert cli("inspect", "log.mcap", "--topic", f"color={shown}").code == 0
    assert len(document["input"]["classes"][0]) <= 120
    assert len(rows("r")) == 4


def test_an_address(replay: Cli, home: Path, tiny_log: Path) -> None:
    """The report knows the log by its name, and nothing of the token that came with its address."""
    pytest.importorskip("aiohttp", reason="needs the extra 'remote'")
    from tests.log.range_server import Behaviour, serving

    with serving(Behaviour({"/logs/far.mcap": tiny_log.read_bytes()})) as host:
        address = f"{host.replace('//', '//me:secret@')}/logs/far.mcap?token=hidden"
        ran = replay(address, "--model", "oracle", "--clock", "offline")
    assert ran.code == 0, ran.err
    (folder,) = (home / "reports" / "far").iterdir()
    assert report(folder)["input"]["logs"][0]["name"] == "far"
    assert f"{host}/logs/far.mcap" in report(folder)["host"]["command"]
    for text in (ran.out, ran.err, *(p.read_bytes().decode("latin-1") for p in folder.rglob("*") if p.is_file())):
        assert "hidden" not in text
        assert "secret" not in text


def assert_fit_to_show(text: str) -> None:
    """Nothing that a terminal would obey, and no line without end."""
    assert all(line.isprintable() and len(line) < 5000 for line in text.splitlines()), text
    assert text.splitlines() == text.split("\n")[: len(text.splitlines())]


def assert_report_is_harmless(folder: Path) -> None:
    """No script, picture or link that the names made."""
    page, text = ((folder / f"report.{kind}").read_text() for kind in ("html", "md"))
    outside_code = re.sub(r"^(`{3,})\n.*?\n\1$", "", text, flags=re.DOTALL | re.MULTILINE)
    assert "<script" not in page
    assert "<script" not in outside_code
    assert "](http" not in outside_code
    assert_fit_to_show(text)
    json.loads((folder / "report.json").read_text())


def named(path: Path, name: str) -> Path:
    """Four frames whose topics, frames, schema and classes are all called `name`."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(name, name)
        channels: dict[str, int] = {}
        writer.add_metadata("stsem.classes", {"0": name, "1": "floor"})
        for i in range(4):
            stamp = 1_700_000_000_000_000_000 + i * 100_000_000
            picture = np.full((16, 16, 3), 10 * i, np.uint8)
            messages: dict[str, Any] = {
                f"/{name}": image(fox.CompressedImage, stamp, name[:500], format="png", data=png(picture)),
                f"/labels/{name}": image(
                    fox.RawImage, stamp, f"{name[:500]}2", encoding="mono8", width=16, height=16, step=16,
                    data=bytes(256),
                ),
                f"/pose/{name}": fox.PoseInFrame(timestamp=seconds(stamp), frame_id=name[:500], pose=fox.Pose(
                    position=fox.Vector3(x=0, y=0, z=0), orientation=fox.Quaternion(x=0, y=0, z=0, w=1))),
            }  # fmt: skip
            for topic, message in messages.items():
                schema = message.get_schema()
                if topic not in channels:
                    number = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[topic] = writer.register_channel(topic, "protobuf", number)
                writer.add_message(channels[topic], stamp, message.encode(), stamp)
        writer.finish()
    return path


def image(kind: Any, stamp: int, frame_id: str, **fields: Any) -> Any:
    return kind(timestamp=seconds(stamp), frame_id=frame_id, **fields)


def seconds(stamp: int) -> Any:
    return fox.Timestamp(sec=stamp // 10**9, nsec=stamp % 10**9)


def png(picture: Any) -> bytes:
    return bytes(cv2.imencode(".png", picture)[1])


def test_the_walk_is_left_alone(replay: Cli, home: Path) -> None:
    """A name that cuts to nothing is still a folder of its own."""
    path = write_walk(home / "....mcap", frames=3)
    assert replay(path, "--model", "oracle", "--clock", "offline").code == 0
    assert [p.name for p in (home / "reports").iterdir()] == ["log"]
