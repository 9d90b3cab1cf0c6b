"""Which paths are parts of one recording."""

import pytest

from stsem.cli.recordings import recordings
from stsem.errors import UsageError


@pytest.mark.parametrize(
    ("paths", "groups"),
    [
        (["a.mcap"], [["a.mcap"]]),
        (["a_0.mcap"], [["a_0.mcap"]]),
        (["b.mcap", "a.mcap"], [["b.mcap"], ["a.mcap"]]),
        (["a_0.mcap", "a_1.mcap", "a_10.mcap"], [["a_0.mcap", "a_1.mcap", "a_10.mcap"]]),
        (["a_0.mcap", "b_0.mcap", "a_1.mcap"], [["a_0.mcap", "a_1.mcap"], ["b_0.mcap"]]),
        (["a.mcap", "a_1.mcap"], [["a.mcap"], ["a_1.mcap"]]),
        (["x/a_0.mcap", "y/a_1.mcap"], [["x/a_0.mcap"], ["y/a_1.mcap"]]),
        (["a_0.mcap", "a_1.txt"], [["a_0.mcap"], ["a_1.txt"]]),
        (["https://h/a_0.mcap?t=1", "https://h/a_1.mcap?t=2"], [["https://h/a_0.mcap?t=1", "https://h/a_1.mcap?t=2"]]),
        (["https://h/a_0.mcap", "https://g/a_1.mcap"], [["https://h/a_0.mcap"], ["https://g/a_1.mcap"]]),
        (["folder_1", "folder_2"], [["folder_1"], ["folder_2"]]),
    ],
)
def test_grouping(paths: list[str], groups: list[list[str]]) -> None:
    """Files of one folder that differ in a trailing number are one log; everything else stands for itself."""
    assert recordings(paths) == [tuple(group) for group in groups]


def test_a_log_given_twice_is_refused_without_its_token() -> None:
    with pytest.raises(UsageError, match=r"^https://h/a\.mcap was given twice"):
        recordings(["https://h/a.mcap?token=1", "https://h/a.mcap?token=1"])


@pytest.mark.parametrize("again", ["./a.mcap", "x/../a.mcap"])
def test_a_log_given_twice_in_other_words_is_refused(again: str) -> None:
    with pytest.raises(UsageError, match="was given twice"):
        recordings(["a.mcap", again])
