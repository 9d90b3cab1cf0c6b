"""The table of contents: which sections a report has, in reading order."""

from collections.abc import Callable

from stsem.document.schema import Document
from stsem.report.outline import Figure, Outline, Section, Text
from stsem.report.sections import accuracy, calibration, headline, origin, space, timing

_Maker = Callable[[Document], Section | None]
_RESULTS: tuple[_Maker, ...] = (
    accuracy.comparison_section, accuracy.loss_section, accuracy.distance_section, timing.latency_section,
    timing.outcomes_section, accuracy.classes_section, calibration.calibration_section,
)  # fmt: skip
_BASIS: tuple[_Maker, ...] = (
    space.space_section, origin.unmeasured_section, origin.input_section, origin.identity_section,
    origin.reproduce_section,
)  # fmt: skip


def outline(document: Document, pictures: frozenset[str], strip_pass: str = "offline") -> Outline:
    """The report of a document.

    Args:
        document: what is reported.
        pictures: names of the pictures that were drawn; the others are left out.
        strip_pass: which pass the answers in the strip come from.
    """
    looks: dict[str, _Maker] = {
        "uncertainty": lambda _: calibration.uncertainty_section(document.accuracy_state == "measured"),
        "strip": lambda _: _strip(document, strip_pass),
    }
    makers = (*_RESULTS, *(make for name, make in looks.items() if name in pictures), *_BASIS)
    sections = [section for make in makers if (section := make(document)) is not None]
    return Outline(
        title=headline.report_title(document),
        state=document.state,
        accuracy_state=document.accuracy_state,
        lead=headline.lead(document),
        tiles=headline.tiles(document),
        warnings=headline.warnings(document),
        sections=tuple(_drawn(section, pictures) for section in sections),
        digest=document.digest,
    )


def _strip(document: Document, strip_pass: str) -> Section:
    judged = document.accuracy_state == "measured"
    text = f"Answers of the {strip_pass} pass." + " Errors are coloured by the mode that made them." * judged
    return Section("Frames", (Figure("strip", "image, truth, answers and errors of some frames"), Text(text)))


def _drawn(section: Section, pictures: frozenset[str]) -> Section:
    kept = tuple(block for block in section.blocks if not isinstance(block, Figure) or block.name in pictures)
    return Section(section.title, kept)
