"""`stsem convert` as users call it: exit codes, what it prints, and what it never does."""

import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from stsem.cli import convert
from stsem.convert.formats import FORMATS

from .conftest import Cli


def image(path: Path, value: int = 90, size: tuple[int, int] = (24, 32)) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), np.full((*size, 3), value, np.uint8))
    return path


@pytest.fixture
def walk(home: Path) -> Path:
    """Three images in a folder `rgb`."""
    for k in range(3):
        image(home / f"walk/rgb/{k}.png", 80 + k)
    return home / "walk"


def test_the_last_line_is_the_command_that_replays_it(cli: Cli, walk: Path, home: Path) -> None:
    """A name with a blank is quoted; assumptions go to stderr, one line each."""
    ran = cli("convert", walk, "my walk.mcap")
    assert ran.code == 0, ran.err
    assert ran.out.splitlines()[-1] == "stsem-replay 'my walk.mcap'"
    assert "/camera/color" in ran.out
    assert "30 images per second were assumed (--rate HZ)" in ran.err
    assert cli("inspect", home / "my walk.mcap").code == 0


def test_without_a_name_the_log_lies_here(cli: Cli, walk: Path, home: Path) -> None:
    assert cli("convert", walk).out.splitlines()[-1] == "stsem-replay walk.mcap"
    assert cli("inspect", "walk.mcap").code == 0
    assert (home / "walk.mcap").is_file()


def test_nothing_is_overwritten_unless_asked_for(cli: Cli, walk: Path, home: Path) -> None:
    (home / "walk.mcap").write_bytes(b"precious")
    ran = cli("convert", walk)
    assert ran.code == 1
    assert ran.sentence == "walk.mcap is there already; give another name, or --force to replace it."
    assert (home / "walk.mcap").read_bytes() == b"precious"
    assert cli("convert", walk, "--force").code == 0
    assert (home / "walk.mcap").read_bytes() != b"precious"


def test_the_source_is_never_the_target(cli: Cli, home: Path) -> None:
    (home / "x.bag").write_bytes(b"#ROSBAG V2.0\n")
    ran = cli("convert", "x.bag", "x.bag", "--force")
    assert (ran.code, ran.sentence) == (1, "x.bag is what is to be converted; give another name for the log.")
    assert (home / "x.bag").read_bytes() == b"#ROSBAG V2.0\n"


def test_a_name_that_does_not_print_is_shown_escaped(cli: Cli, walk: Path, home: Path) -> None:
    """It cannot reach the terminal as a command, nor stop the one line that says what was written."""
    walk.rename(home / "walk\udcff\x1b[31m")
    ran = cli("convert", home / "walk\udcff\x1b[31m")
    assert ran.code == 0, ran.err
    assert ran.out.splitlines()[-1] == r"stsem-replay 'walk\udcff\x1b[31m.mcap'"


def test_losses_are_exit_code_3_with_counts(cli: Cli, walk: Path) -> None:
    (walk / "rgb/1.png").write_bytes(b"not an image")
    image(walk / "rgb/2.png", size=(8, 8))
    ran = cli("convert", walk)
    assert ran.code == 3
    assert "Left out: 1 colour images that cannot be read." in ran.err
    assert "Left out: 1 colour images of another size than the first." in ran.err
    assert ran.out.splitlines()[-1] == "stsem-replay walk.mcap"


def test_a_log_that_cannot_be_written_leaves_nothing(cli: Cli, walk: Path, home: Path) -> None:
    ran = cli("convert", walk, "missing/walk.mcap")
    assert ran.code == 1
    assert "cannot be written" in ran.sentence
    assert cli("convert", walk, home).code == 1
    for path in walk.glob("rgb/*"):
        path.write_bytes(b"not an image")
    assert "No colour image could be read" in cli("convert", walk).err
    assert [path.name for path in home.iterdir()] == ["walk"]


def test_a_source_in_no_format_lists_them(cli: Cli, home: Path) -> None:
    (home / "empty").mkdir()
    (home / "notes.txt").write_text("hello")
    for source in ("empty", "notes.txt"):
        ran = cli("convert", source)
        assert ran.code == 1
        for name, row in FORMATS.items():
            assert f"{name} ({row.expects})" in ran.sentence
    assert cli("convert", "nowhere").sentence == "There is no nowhere; give the folder or the file to convert."


def test_an_mcap_log_needs_no_conversion(cli: Cli, tiny_log: Path) -> None:
    """Nor does the folder of a ROS 2 bag whose storage is MCAP."""
    for source in (tiny_log, tiny_log.parent):
        ran = cli("convert", source)
        assert ran.code == 1
        assert "is an MCAP log already, nothing needs to be converted" in ran.sentence


def test_two_formats_that_fit_are_named(cli: Cli, walk: Path) -> None:
    """--from decides."""
    (walk / "rgb.txt").write_text("1305031102.5 rgb/0.png\n")
    image(walk / "results/frame000000.jpg")
    ran = cli("convert", walk)
    assert ran.code == 1
    assert ran.sentence.endswith("could be tum, nice-slam; say which with --from FORMAT.")
    assert cli("convert", walk, "--from", "nice-slam").code == 0


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["--from", "tmu"], "--from is 'tmu' (did you mean tum?), but it can be"),
        (["--rate", "0"], "--rate is 0, but it must be above 0."),
        (["--rate", "nan"], "--rate is nan, but it must be above 0."),
        (["--depth-scale", "-5"], "--depth-scale is -5, but it must be above 0."),
    ],
)
def test_values_that_cannot_be_are_usage_errors(cli: Cli, walk: Path, flags: list[str], sentence: str) -> None:
    ran = cli("convert", walk, *flags)
    assert ran.code == 2
    assert ran.sentence.startswith(sentence)


def test_every_format_is_named_in_help_and_docs() -> None:
    """The help lists them without loading them; docs/convert.md has a row for each, with what lies on disk."""
    listed = convert.HELP.split("Formats: ")[1].split(" (docs")[0].split(", ")
    assert sorted(listed) == sorted(FORMATS)
    text = (Path(__file__).resolve().parents[2] / "docs" / "convert.md").read_text()
    rows = {line.split("|")[1].strip().strip("`"): line for line in text.splitlines() if line.startswith("| `")}
    assert sorted(rows) == sorted(FORMATS)
    for name, row in FORMATS.items():
        assert row.summary in rows[name]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_conversion_that_is_ended_leaves_nothing(tmp_path: Path, number: int) -> None:
    """Exit code 1 and a sentence that does not speak of reports."""
    image(tmp_path / "images/0.png")
    code = (
        "import sys, threading\nfrom stsem.cli import main\nfrom stsem.convert import write\n"
        "def slow(log, event):\n"
        "    print('now', flush=True)\n"
        "    threading.Event().wait(60)\n"
        "write._write = slow\n"
        "sys.argv = ['stsem', 'convert', 'images']\n"
        "main.stsem()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "now\n"
        assert len(list(tmp_path.glob(".images.mcap.*"))) == 1
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err.strip().endswith("; nothing half-written is left behind.")
    assert [path.name for path in tmp_path.iterdir()] == ["images"]


@pytest.mark.parametrize("name", [name for name, row in FORMATS.items() if not row.several])
def test_a_sequence_of_what_is_one(cli: Cli, walk: Path, home: Path, name: str) -> None:
    """Nobody chose anything, so nothing is converted."""
    ran = cli("convert", walk, "--from", name, "--sequence", "q")
    assert ran.code == 2
    assert "--sequence is 'q'" in ran.sentence
    assert not (home / "walk.mcap").exists()
