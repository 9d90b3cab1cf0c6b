"""report.html: the whole report in one file, without scripts; light and dark, on screen and in print."""

import base64
import re
from collections.abc import Mapping

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from stsem.report.outline import Block, Outline
from stsem.report.plots.gallery import Picture
from stsem.report.plots.style import MODE_COLOURS, PNG_DPI

CSS_DPI = 96


def html(report: Outline, pictures: Mapping[str, Picture]) -> str:
    """The whole report.

    Args:
        report: what it says.
        pictures: name -> picture; drawn ones stand inline as SVG, photographs as base64 PNG.
    """
    environment = Environment(
        loader=PackageLoader("stsem.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters.update(
        inline=_inline, kind=_kind, is_words=_is_words, swatch=_swatch, picture=lambda name: _picture(pictures[name])
    )
    return environment.get_template("template.html").render(report=report)


def _kind(block: Block) -> str:
    return type(block).__name__


def _inline(text: str) -> Markup:
    """`code` and **bold** as in Markdown; everything else is text."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return Markup(re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", marked))


def _swatch(name: str) -> Markup:
    """A square in the colour of a mode before its name; other names as they are."""
    if name not in MODE_COLOURS:
        return _inline(name)
    return Markup('<i class="swatch {0}"></i>{0}').format(name)


def _is_words(cell: str) -> bool:
    """Whether a cell of a column of numbers holds a reason instead."""
    return any(ch.isalpha() for ch in cell) and not any(ch.isdigit() for ch in cell[:2])


def _picture(picture: Picture) -> Markup:
    if picture.svg is not None:
        return Markup(picture.svg)
    data = base64.b64encode(picture.png).decode()
    width = int.from_bytes(picture.png[16:20]) * CSS_DPI // PNG_DPI
    return Markup('<img alt="" style="width: {}px" src="data:image/png;base64,{}">').format(width, data)
