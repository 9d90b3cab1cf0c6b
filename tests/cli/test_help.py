"""What can be chosen is said by --help."""

import re
import sys
from typing import get_args

import pytest

from stsem.cli import main
from stsem.inference.backends import BACKENDS, PRECISIONS
from stsem.replay.config import PoseSource
from stsem.replay.modes import MODES
from stsem.stages.propagate import AUTO, PROPAGATIONS
from stsem.stages.select import POLICIES

CHOICES = {
    "--mode": list(MODES),
    "--propagation": [AUTO, *PROPAGATIONS],
    "--keyframes": [spelling for spelling, _ in POLICIES.values()],
    "--backend": list(BACKENDS),
    "--precision": list(PRECISIONS),
    "--pose": list(get_args(PoseSource)),
}


@pytest.fixture
def help_text(wide_terminal: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """`stsem-replay --help` as plain text."""
    monkeypatch.setattr(sys, "argv", ["stsem-replay", "--help"])
    with pytest.raises(SystemExit) as end:
        main.stsem_replay()
    assert end.value.code in (0, None)
    return re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)


@pytest.mark.parametrize("option", list(CHOICES))
def test_every_choice_is_named_beside_its_option(help_text: str, option: str) -> None:
    (line,) = (line for line in help_text.splitlines() if re.match(rf"\W*{option}(?!\S)", line))
    named = set(re.findall(r"[\w:-]+", line.partition(option)[2]))
    assert CHOICES[option]
    assert set(CHOICES[option]) <= named


@pytest.mark.parametrize(("option", "default"), [("--out", "[training]"), ("--recipe", "[scratch]"), ("--seed", "[0]")])
def test_defaults_in_square_brackets_are_shown(
    wide_terminal: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], option: str, default: str
) -> None:
    """They are no markup."""
    monkeypatch.setattr(sys, "argv", ["stsem", "train", "--help"])
    with pytest.raises(SystemExit):
        main.stsem()
    (line,) = (line for line in capsys.readouterr().out.splitlines() if re.match(rf"\W*{option}(?!\S)", line))
    assert default in line
    assert "\\" not in line
