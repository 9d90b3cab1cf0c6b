"""Which paths are parts of one recording."""

from pathlib import Path

import pytest

from stsem.cli.recordings import recordings


@pytest.mark.parametrize(
    ("paths", "groups"),
    [
        (["a.mcap"], [["a.mcap"]]),
        (["a_0.mcap"], [["a_0.mcap"]]),
        (["b.mcap", "a.mcap"], [["b.mcap"], ["a.mcap"]]),
        (["a_0.mcap", "a_1.mcap", "a_10.mcap"], [["a_0.mcap", "a_1.mcap", "a_10.mcap"]]),
        (["a_0.mcap", "b_0.mcap", "a_1.mcap"], [["a_0.mcap", "a_1.mcap"], ["b_0.mcap"]]),
        (["x/a_0.mcap", "y/a_1.mcap"], [["x/a_0.mcap"], ["y/a_1.mcap"]]),
        (["a_0.mcap", "a_1.txt"], [["a_0.mcap"], ["a_1.txt"]]),
        (["folder_1", "folder_2"], [["folder_1"], ["folder_2"]]),
    ],
)
def test_grouping(paths: list[str], groups: list[list[str]]) -> None:
    """Files of one folder that differ in a trailing number are one log; everything else stands for itself."""
    assert recordings([Path(p) for p in paths]) == [tuple(Path(p) for p in group) for group in groups]
