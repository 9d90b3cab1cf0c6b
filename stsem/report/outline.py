"""A report before it has a form: sections of tables, sentences and pictures, which Markdown and HTML both render."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Args:
        name: heading, with the unit.
        meaning: what the numbers below are; a tooltip in HTML.
        number: whether it is set flush right.
    """

    name: str
    meaning: str = ""
    number: bool = True


@dataclass(frozen=True)
class Row:
    """A row of a table: its cells, and what its first cell means."""

    cells: tuple[str, ...]
    meaning: str = ""
    total: bool = False


@dataclass(frozen=True)
class Table:
    """A table; `notes` below it say what the numbers mean and what they rest on."""

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Text:
    """One paragraph; `code` and **bold** as in Markdown."""

    text: str


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    items: tuple[str, ...]
    warning: bool = False


@dataclass(frozen=True)
class Figure:
    """A picture of the gallery, by name, and what it shows."""

    name: str
    alternative: str


@dataclass(frozen=True)
class Code:
    """Text to be copied, or a configuration."""

    text: str


@dataclass(frozen=True)
class Folded:
    """Blocks that are out of the way until asked for."""

    title: str
    blocks: tuple["Block", ...]


Block = Table | Text | Items | Figure | Code | Folded


@dataclass(frozen=True)
class Section:
    """A titled part of the report."""

    title: str
    blocks: tuple[Block, ...]

    @property
    def anchor(self) -> str:
        """The title as the fragment of a link, as GitHub forms it."""
        return "".join(c for c in self.title.lower().replace(" ", "-") if c.isalnum() or c == "-")


@dataclass(frozen=True)
class Tile:
    """One headline number: the compared mode, large, and against what.

    Args:
        name: the metric.
        value: the compared mode's value, with its unit.
        mode: the compared mode.
        against: the base's value and mode in words; empty with one mode.
        delta: the difference with its interval; empty with one mode.
        good: whether the difference is an improvement; None where that cannot be told.
        meaning: the definition.
    """

    name: str
    value: str
    mode: str
    against: str = ""
    delta: str = ""
    good: bool | None = None
    meaning: str = ""


@dataclass(frozen=True)
class Outline:
    """A whole report.

    Args:
        title: the log and the network.
        state: `valid`, `lossy` or `invalid`.
        accuracy_state: `measured` or `not measured`.
        lead: what a hurried reader must know, a few sentences.
        tiles: headline numbers.
        warnings: what must be known before a number is believed.
        sections: the rest, in reading order.
        digest: what identifies the results.
    """

    title: str
    state: str
    accuracy_state: str
    lead: tuple[str, ...]
    sections: tuple[Section, ...]
    digest: str
    tiles: tuple[Tile, ...] = ()
    warnings: tuple[str, ...] = field(default=())
