"""--annotate leaves a log beside the report that viewers open, and that stsem reads back."""

from collections import Counter
from pathlib import Path

from mcap.reader import make_reader

from .conftest import Cli, rows


def test_an_annotated_log_holds_every_answer(replay: Cli, home: Path, tiny_log: Path) -> None:
    """As many messages per mode as answers in frames.csv, one map, and one pose per answered frame."""
    assert replay(tiny_log, "--model", "oracle", "--annotate", "--out", "r").code == 0
    with (home / "r" / "annotated.mcap").open("rb") as file:
        found = Counter(channel.topic for _, channel, _ in make_reader(file, validate_crcs=True).iter_messages())
    answered = [row for row in rows("r") if row["answered_ns"]]
    for mode in ("per-frame", "keyframe"):
        expected = sum(row["mode"] == mode for row in answered)
        assert expected > 0
        assert {found[f"/stsem/{mode}/{kind}"] for kind in ("overlay", "labels", "answer")} == {expected}
    assert found["/stsem/map"] == 1
    assert found["/stsem/pose"] == len({row["frame"] for row in answered})


def test_without_annotate_there_is_none(replay: Cli, home: Path, tiny_log: Path) -> None:
    assert replay(tiny_log, "--model", "oracle", "--out", "r").code == 0
    assert not (home / "r" / "annotated.mcap").exists()
