"""docs/networks.md says what the networks are: its table is counted, its names exist."""

import re
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.errors import UsageError
from stsem.models.cost import counted
from stsem.models.names import FAMILIES
from stsem.models.sizes import kept, table
from stsem.models.zoo import ZOO, find

pytestmark = pytest.mark.torch
DOCUMENT = (Path(__file__).parents[2] / "docs" / "networks.md").read_text(encoding="utf-8")


def test_the_table_is_counted() -> None:
    """Names, weights, multiply-adds and papers; `python -m stsem.models.cost` writes them again, and
    `stsem export --list` prints the document's table."""
    assert kept() == tuple(map(counted, ZOO))
    assert all(size.parameters > 1e6 and size.multiply_adds > 1e9 for size in kept())
    assert table() in DOCUMENT


def test_every_network_is_described() -> None:
    """In words, beside the table; what looks like a name of one is one."""
    words = DOCUMENT.replace(table(), "")
    for name in ZOO:
        assert f"`{name}`" in words or f"`{name.rpartition('-')[2]}`" in words or "pspnet" in name, name
    for name in re.findall(r"`((?:pspnet-r|fcn-|parsenet|segnet|deeplab|crf-|fusenet|adapnet)[\w-]*)`", words):
        try:
            find(name)
        except UsageError:
            assert name.endswith("-"), name


def test_families_of_weights_are_described() -> None:
    """The names by which a family is told."""
    section = DOCUMENT.partition("## Weights from elsewhere")[2].partition("\n## ")[0]
    for family in FAMILIES:
        assert all(f"`{sign}`" in section for sign in family.signs), family.title
