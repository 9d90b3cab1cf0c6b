"""Calibration and uncertainty in tables and pictures, and their absence."""

import re
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest
from made_up_run import example

from stsem.document.canonical import as_json, canonical, document_from, results_digest
from stsem.report.contents import outline
from stsem.report.inputs import ReportInputs
from stsem.report.markdown import markdown
from stsem.report.plots import calibration, uncertainty
from stsem.uncertainty import Uncertainty


@pytest.fixture(scope="module")
def inputs() -> ReportInputs:
    return example()


def _labels(figure: object) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]  # type: ignore[attr-defined]


def test_every_number_stands_in_a_table(inputs: ReportInputs) -> None:
    text = markdown(outline(inputs.document, frozenset()))
    assert re.search(r"\| per-frame \| segmented +\| offline +\| +6\.0 \| +6\.0 \| +90\.0 \| +95\.0 \|", text)
    assert re.search(r"\| keyframe +\| propagated \| offline +\| +2\.0 \|", text)
    assert re.search(r"\| keyframe +\| all +\| delivered \|", text)
    rows = re.findall(
        r"^\| (1 − confidence|variance|entropy|mutual information) +\| +(\S+) \| +(\S+) \|", text, re.MULTILINE
    )
    assert rows == [("1 − confidence", "0.910", "0.910"), ("variance", "0.850", "0.850"), ("entropy", "0.880", "0.880"),
                    ("mutual information", "0.860", "0.860")]  # fmt: skip
    assert "## Uncertainty" not in text


def test_the_network_has_one_curve_and_each_prediction_its_own(inputs: ReportInputs) -> None:
    """Both modes segment with the same network; bins without pixels are not drawn."""
    figure = calibration.draw(inputs)
    assert figure is not None
    assert _labels(figure) == ["per-frame, segmented: ECE 6.0 %", "keyframe, propagated: ECE 2.0 %"]
    curves = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    assert [len(curve.get_xdata()) for curve in curves] == [13, 13]
    assert curves[0].get_xdata()[0] == pytest.approx(100 * 2.5 / 15)


def test_the_unsure_frame_has_two_rows(inputs: ReportInputs) -> None:
    """Pictures above, a map per measure below, each with its largest value and the area of the run."""
    figure = uncertainty.draw(inputs)
    assert figure is not None
    headings = [axes.get_title(loc="left") for axes in figure.axes]
    assert headings == ["image", "truth", "answer", "wrong pixels", "variance", "entropy", "mutual information",
                        "1 − confidence", "Uncertainty"]  # fmt: skip
    assert figure.axes[4].get_xlabel().endswith("AUC 0.85")
    assert "nats; AUC 0.88" in figure.axes[5].get_xlabel()
    red = np.asarray(figure.axes[3].images[0].get_array())
    assert inputs.unsure is not None
    wrong = (red == (0xB4, 0x23, 0x18)).all(axis=2)
    np.testing.assert_array_equal(
        wrong, (inputs.unsure.truth != inputs.unsure.labels) & (np.asarray(inputs.unsure.truth) != 255)
    )


def test_without_truth_the_maps_are_shown_alone() -> None:
    inputs = example(truth=False)
    figure = uncertainty.draw(inputs)
    assert figure is not None
    assert [axes.get_title(loc="left") for axes in figure.axes][:3] == ["image", "answer", "variance"]
    assert "AUC" not in figure.axes[2].get_xlabel()
    assert calibration.draw(inputs) is None
    text = markdown(outline(inputs.document, frozenset({"uncertainty"})))
    assert "## Uncertainty" in text
    assert "## Confidence" not in text


def test_a_map_without_any_doubt_is_drawn(inputs: ReportInputs) -> None:
    """All zero: a range of no width is none to divide by."""
    assert inputs.unsure is not None
    sure = Uncertainty(("entropy",), np.zeros((1, 270, 480), np.uint8), 13)
    figure = uncertainty.draw(replace(inputs, unsure=replace(inputs.unsure, uncertainty=sure)))
    assert figure is not None
    assert figure.axes[4].get_xlabel() == "0 to 0 nats; AUC 0.88"


def test_no_maps_no_picture(inputs: ReportInputs) -> None:
    assert uncertainty.draw(replace(inputs, unsure=None)) is None


def test_older_reports_are_read_and_older_baselines_hold(inputs: ReportInputs) -> None:
    """A report without these parts is one where they are empty; its results have the digest that they had."""
    older = as_json(inputs.document)
    for run in older["runs"]:  # type: ignore[union-attr]
        del run["calibration"], run["error_detection"]  # type: ignore[union-attr, arg-type, index]
    read = document_from(older, "older.json")
    assert all((run.calibration, run.error_detection) == ({}, None) for run in read.runs)
    keys = ("schema_version", "state", "accuracy_state", "input", "runs", "comparison", "more_comparisons")
    assert results_digest(read) == sha256(canonical({key: older[key] for key in keys})).hexdigest()
    assert results_digest(read) != results_digest(inputs.document)
    assert calibration.draw(ReportInputs(read)) is None
