"""frames.csv: exact, complete, one row per frame and mode."""

import csv
import io

from made_up_run import FRAMES, MODES, example

from stsem.report.frames_csv import frames_csv


def rows() -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(b"".join(frames_csv(example(pictures=False))).decode())))


def test_every_frame_of_every_mode_has_one_row() -> None:
    assert [(row["mode"], int(row["frame"])) for row in rows()] == [(m, i) for m in MODES for i in range(FRAMES)]


def test_times_are_exact_integers_and_absent_ones_blank() -> None:
    """Nanoseconds of today do not fit a float; a dropped frame has no answer to time."""
    by_key = {(row["mode"], row["frame"]): row for row in rows()}
    first = by_key["per-frame", "0"]
    assert first["log_stamp_ns"] == "1700000000000000123"
    assert int(first["latency_from_arrival_ns"]) == int(first["answered_ns"]) - int(first["arrival_ns"])
    dropped = by_key["per-frame", "2"]
    assert (dropped["outcome"], dropped["answered_ns"], dropped["keyframe"]) == ("dropped_busy", "", "")


def test_waiting_and_services_add_up_to_the_latency() -> None:
    answered = [row for row in rows() if row["answered_ns"]]
    assert {row["mode"] for row in answered} == set(MODES)
    for row in answered:
        inside = sum(int(row[f"{stage}_service_ns"] or 0) for stage in ("register", "segment", "propagate"))
        assert inside > 0
        assert int(row["waiting_ns"]) + inside == int(row["latency_from_arrival_ns"])
        assert int(row["waiting_ns"]) >= 0


def test_distance_is_to_the_keyframe() -> None:
    predicted = [row for row in rows() if row["outcome"] == "propagated"]
    assert predicted
    for row in predicted:
        assert int(row["distance_frames"]) == int(row["frame"]) - int(row["keyframe"]) > 0
        assert int(row["distance_ns"]) == 100_000_000 * int(row["distance_frames"])
    assert {row["distance_frames"] for row in rows() if row["outcome"] == "segmented"} == {"0"}
    assert {row["distance_frames"] for row in rows() if not row["keyframe"]} == {""}


def test_floats_read_back_equal() -> None:
    inputs = example(pictures=False)
    written = [row["offline_pixel_accuracy"] for row in rows()]
    assert [float(text) for text in written] == [row.offline for mode in MODES for row in inputs.rows(mode)]
