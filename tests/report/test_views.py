"""Markdown and HTML: one outline, every number with its basis, nothing blank."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
from made_up_comparison import with_third_mode
from made_up_run import example

from stsem.document.accuracy import Score
from stsem.document.schema import MapScore, Run
from stsem.document.timing import Latency, Outcomes, Throughput
from stsem.document.trajectory import TrajectoryScore
from stsem.report.contents import outline
from stsem.report.frames_csv import frames_csv
from stsem.report.html import html
from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.markdown import markdown
from stsem.report.outline import Section, Table
from stsem.report.plots.gallery import Picture, draw_all
from stsem.report.plots.style import STAGE_COLOURS, UNKNOWN_STAGE
from stsem.report.terminal import closing_table
from stsem.result import STAGES, FrameResult, Outcome

VARIANTS = {"full": {}, "no truth": {"truth": False}, "lossy": {"lossy": True}, "offline": {"clock": False}}


@pytest.fixture(scope="module", params=VARIANTS)
def views(request: pytest.FixtureRequest) -> tuple[ReportInputs, str, str]:
    inputs = example(pictures=False, **VARIANTS[request.param])
    pictures = {name: Picture(name, b"png", f"<svg>{name}</svg>") for name in ("loss", "classes", "latency")}
    report = outline(inputs.document, frozenset(pictures))
    return inputs, markdown(report), html(report, pictures)


class Checker(HTMLParser):
    """Counts what must not be there, and whether every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.ids: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.ids += [value or "" for key, value in attrs if key == "id"]
        self.links += [value or "" for key, value in attrs if key in ("href", "src", "xlink:href")]
        if tag not in ("meta", "br", "img", "link"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open
        assert self.open.pop() == tag


def check(page: str) -> Checker:
    checker = Checker()
    checker.feed(page)
    assert checker.open == []
    return checker


def test_views_have_no_blank_and_no_nan(views: tuple[ReportInputs, str, str]) -> None:
    _, text, page = views
    """Beside the configuration, which may well hold null."""
    for view in (re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.sub(r"<pre>.*?</pre>", "", page, flags=re.DOTALL)):
        assert not re.search(r"\b(nan|None|null)\b", view)
    for line in text.splitlines():
        if line.startswith("|") and "sum" not in line:
            assert "||" not in line


def test_html_is_one_file_without_scripts(views: tuple[ReportInputs, str, str]) -> None:
    found = check(views[2])
    assert found.tags.isdisjoint({"script", "link", "iframe"})
    assert all(link.startswith(("#", "data:")) for link in found.links)
    assert len(found.ids) == len(set(found.ids))
    assert {link[1:] for link in found.links if link.startswith("#")} <= set(found.ids)


def test_state_and_accuracy_stand_at_the_top(views: tuple[ReportInputs, str, str]) -> None:
    inputs, text, page = views
    head = text.split("## ")[0]
    document = inputs.document
    assert document.digest[:12] in head
    assert f"accuracy {document.accuracy_state}" in head
    assert document.verdict.text in head
    for reason in document.state_reasons:
        assert reason in head
        assert reason in page
    if document.accuracy_state == "measured":
        assert "150 of 150 frames (150 have truth); mIoU averages the 11 classes" in head
    else:
        assert "Accuracy was not measured: the log has no channel with labels." in head


def test_outcomes_sum_stands_beside_the_frames(views: tuple[ReportInputs, str, str]) -> None:
    text = views[1]
    assert re.search(r"\*\*sum\*\* +\| +\*\*150\*\* \| +\*\*150\*\* \|", text)
    assert re.search(r"\*\*frames of the log\*\* +\| +\*\*150\*\* \| +\*\*150\*\* \|", text)


def test_both_views_say_the_same(views: tuple[ReportInputs, str, str]) -> None:
    """Every section and every cell of Markdown is in HTML too."""
    _, text, page = views
    plain = re.sub(r"<[^>]+>", "", page).replace("&#39;", "'").replace("&lt;", "<").replace("&gt;", ">")
    for title in re.findall(r"^## (.+)$", text, flags=re.MULTILINE):
        assert f"<h2>{title}</h2>" in page
    for row in re.findall(r"^\|(?!:|-)(.+)\|$", text, flags=re.MULTILINE):
        for cell in row.split("|"):
            assert cell.strip().replace("`", "").replace("*", "") in plain


def test_reading_order_and_basis() -> None:
    """From the verdict down; every table of scores has notes that define them."""
    report = outline(example(pictures=False).document, frozenset({"strip", "uncertainty"}))
    titles = [section.title for section in report.sections]
    wanted = ["Comparison", "Where the mIoU is lost", "By distance to the keyframe", "Latency and throughput",
              "What became of the frames", "Classes", "Confidence", "Uncertainty", "Frames", "Not measured", "Input",
              "Reproduce"]  # fmt: skip
    assert all(titles.index(a) < titles.index(b) for a, b in pairwise(wanted))
    first: Section = report.sections[0]
    table = first.blocks[0]
    assert isinstance(table, Table)
    assert any("Mean of the IoU over the classes that have truth pixels" in note for note in table.notes)
    assert [tile.value for tile in report.tiles] == ["70.4 %", "77.4 %", "16.1 ms", "9.92 Hz"]
    assert [tile.good for tile in report.tiles] == [True, False, True, True]


def test_the_headline_compares_the_mode_that_it_names() -> None:
    """Of three modes, the tiles show the last against the first, and each pair has its sentence."""
    document = with_third_mode(example(pictures=False).document)
    report = outline(document, frozenset())
    rate = report.tiles[-1]
    base, other = (run.throughput.output_hz or 0 for run in (document.runs[0], document.runs[2]) if run.throughput)
    assert (rate.mode, rate.value, rate.delta) == ("keyframe-async", f"{other:.2f} Hz", f"{other - base:+.2f} Hz")
    said = [text for text in report.lead if " against `per-frame`" in text]
    assert [text.split("`")[1] for text in said] == ["keyframe", "keyframe-async"]


def test_poses_and_map_in_units_of_readers() -> None:
    inputs = example(pictures=False)
    space = {
        "trajectory": TrajectoryScore(tracked_share=0.875, ate_rmse_m=0.0123, n=100),
        "map": MapScore(points=12345),
    }
    runs = tuple(run.model_copy(update=space) for run in inputs.document.runs)
    text = markdown(outline(inputs.document.model_copy(update={"runs": runs}), frozenset()))
    assert re.search(r"\| tracked share, % +\| +87\.5 \| +87\.5 \|", text)
    assert re.search(r"\| ate rmse, m +\| +0\.012 \| +0\.012 \|", text)
    assert re.search(r"\| points +\| +12 345 \| +12 345 \|", text)


def test_what_was_not_measured_is_grouped_by_reason() -> None:
    inputs = example(pictures=False)
    first, second = inputs.document.runs
    runs = (
        first.model_copy(update={"not_measured": {"offline": "no truth", "throughput.sustainable_hz": "no truth"}}),
        second.model_copy(update={"not_measured": {"offline": "no truth", "map": "no depth"}}),
    )
    text = markdown(outline(inputs.document.model_copy(update={"runs": runs}), frozenset()))
    assert "- offline: no truth\n- throughput: sustainable hz: no truth (per-frame)\n- map: no depth (keyframe)" in text


def test_text_from_the_log_cannot_break_the_page() -> None:
    inputs = example(pictures=False)
    log = inputs.document.input.logs[0].model_copy(update={"name": "<script>alert(1)</script>|x"})
    document = inputs.document.model_copy(update={"input": inputs.document.input.model_copy(update={"logs": (log,)})})
    report = outline(document, frozenset())
    assert check(html(report, {})).tags.isdisjoint({"script"})
    assert "\\|x" in markdown(report)


def test_odd_names_of_classes_are_drawn_as_they_are() -> None:
    """No mathematics in `$x$`, and no warning for a script that the font lacks."""
    inputs = example(pictures=False)
    first, second = inputs.document.runs
    renamed = {"$wall_{x$": 0.5, "床": 0.25, "a & <b>": 0.75}
    score = Score(miou=0.5, pixel_accuracy=0.5, classes_averaged=3, iou=renamed, n=5)
    runs = tuple(run.model_copy(update={"offline": score, "streaming": None}) for run in (first, second))
    names = inputs.document.input.model_copy(update={"classes": tuple(renamed)})
    document = inputs.document.model_copy(update={"runs": runs, "input": names})
    pictures = draw_all(replace(inputs, document=document))
    page = html(outline(document, frozenset(pictures)), pictures)
    check(page)
    assert "$wall_{x$" in page


def test_nothing_measured_is_a_report_too() -> None:
    inputs = example(pictures=False)
    document = inputs.document.model_copy(
        update={"state": "invalid", "accuracy_state": "not measured", "accuracy_reason": "no frame could be decoded",
                "state_reasons": ("No frame could be decoded.",), "runs": (), "comparison": None}
    )  # fmt: skip
    empty = ReportInputs(document)
    assert draw_all(empty) == {}
    report = outline(document, frozenset())
    assert "**INVALID**" in markdown(report)
    assert check(html(report, {})).tags
    assert "Accuracy was not measured: no frame could be decoded." in closing_table(document)
    assert b"".join(frames_csv(empty)).count(b"\n") == 1


def test_a_run_without_any_answer_is_a_report_too() -> None:
    """Everything undecodable: no latency, no distance, no picture of what is not there."""
    inputs = example(pictures=False)
    first = inputs.document.runs[0]
    coverage = first.coverage.model_copy(update={"scored": 0})
    bare = Run(mode="per-frame", clock="real-time", frames=150, outcomes=Outcomes(undecodable=150), coverage=coverage,
               latency_ms=Latency(), throughput=Throughput())  # fmt: skip
    results = [FrameResult(i, i, None, None, None, Outcome.UNDECODABLE) for i in range(150)]
    rows = tuple(FrameRow("per-frame", result, result.index) for result in results)
    document = inputs.document.model_copy(
        update={"runs": (bare,), "comparison": None, "accuracy_state": "not measured"}
    )
    nothing = ReportInputs(document, {"per-frame": rows})
    assert draw_all(nothing) == {}
    report = outline(document, frozenset())
    check(html(report, {}))
    assert "0 of 150 frames answered" in markdown(report)
    assert "nan" not in closing_table(document)
    assert b"".join(frames_csv(nothing)).count(b"undecodable") == 150


def test_a_single_mode_is_reported_without_comparison() -> None:
    inputs = example(pictures=False)
    document = inputs.document.model_copy(update={"runs": inputs.document.runs[:1], "comparison": None})
    text = markdown(outline(document, frozenset()))
    assert "## Result" in text
    assert "`per-frame`: streaming mIoU 59.9 %; mean latency 218.1 ms; 88 of 150 frames answered." in text


def test_drawn_pictures_stand_inline_and_follow_the_theme(written: Path) -> None:
    page = (written / "report.html").read_text()
    assert "xlink:href" in page
    drawn = re.findall(r"<svg .*?</svg>", page, flags=re.DOTALL)
    assert len(drawn) == 7
    assert page.count("data:image/png;base64,") == 2
    for picture in drawn:
        check(picture)
        assert "<metadata" not in picture
        assert "var(--ink, #1f2328)" in picture
    found = check(page)
    assert len(found.ids) == len(set(found.ids))


def test_png_has_no_date(written: Path) -> None:
    for path in (written / "plots").iterdir():
        data = path.read_bytes()
        assert data.startswith(b"\x89PNG")
        assert b"tIME" not in data
        assert b"tEXt" not in data


def test_pictures_are_left_out_where_there_is_nothing_to_show() -> None:
    assert list(draw_all(example(truth=False))) == ["latency", "timeline", "uncertainty", "strip"]
    assert "latency" not in draw_all(example(truth=False, clock=False, pictures=False))


def test_every_stage_has_a_colour_of_its_own() -> None:
    assert set(STAGE_COLOURS) == set(STAGES)
    assert len({*STAGE_COLOURS.values(), UNKNOWN_STAGE}) == len(STAGES) + 1
