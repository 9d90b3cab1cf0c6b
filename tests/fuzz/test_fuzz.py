"""A few of the mutants of every log, all that once failed, and proof that the judge would notice."""

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from tests.fuzz import impatient
from tests.fuzz.campaign import judging, tasks
from tests.fuzz.evaluate import Bench, Outcome
from tests.fuzz.judge import failure, sentence_trouble
from tests.fuzz.mutate import OPERATORS, Draw, mutant, record_places
from tests.fuzz.regressions import REGRESSIONS
from tests.fuzz.subjects import SUBJECTS, written
from tests.fuzz.workers import verdicts

MUTANTS = 135
FIRST_SEED = 1_000_000


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return written(tmp_path_factory.mktemp("logs"))


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """In this process; its environment and its folder are put back."""
    environment, folder = dict(os.environ), Path.cwd()
    yield Bench(tmp_path / "bench")
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)


def test_no_mutant_fails() -> None:
    chosen = [*REGRESSIONS, *tasks(list(SUBJECTS), FIRST_SEED, FIRST_SEED + MUTANTS)]
    found = list(verdicts(judging, chosen, processes=2))
    assert [(v.log, v.seed, v.operators, v.reason) for v in found if v.reason] == []
    assert sorted((v.log, v.seed) for v in found) == sorted(chosen)
    kind_of = {(v.log, v.seed): v.kind for v in found}
    assert {task: kind_of[task] for task in REGRESSIONS} == {task: kind for task, (kind, _) in REGRESSIONS.items()}
    kinds = Counter(verdict.kind for verdict in found)
    assert kinds.keys() == {"valid", "lossy", "refused"}
    assert kinds["lossy"] > MUTANTS // 2


def test_a_mutant_is_a_function_of_log_and_seed(logs: dict[str, bytes]) -> None:
    made = [mutant(logs, name, seed).data for name, seed in tasks(list(logs), 0, 60)]
    assert made == [mutant(logs, name, seed).data for name, seed in tasks(list(logs), 0, 60)]
    assert len(set(made)) == len(made)


@pytest.mark.parametrize("operator", OPERATORS, ids=lambda operator: operator.__name__)
def test_every_operator_changes_logs(operator: Callable[[Draw], None], logs: dict[str, bytes]) -> None:
    changed = 0
    for seed in range(30):
        draw = Draw(np.random.Generator(np.random.PCG64(seed)), bytearray(logs["ours"]), logs["json"])
        operator(draw)
        changed += bytes(draw.data) != logs["ours"]
    assert changed > 15
    empty = Draw(np.random.Generator(np.random.PCG64(1)), bytearray(b"x"), logs["json"])
    operator(empty)


def test_a_score_that_differs_in_silence_is_a_failure(bench: Bench, logs: dict[str, bytes]) -> None:
    """In a log that nothing protects a pixel is changed; judged as one that is protected."""
    whole = bench.evaluate(logs["bare-protobuf"])
    again = bench.evaluate(logs["bare-protobuf"])
    assert (whole.kind, failure("protobuf", again, {"protobuf": whole.content})) == ("valid", "")
    broken = bytearray(logs["bare-protobuf"])
    image = next(at for at in record_places(broken) if broken[at] == 5 and b"rgb8" in broken[at : at + 200])
    broken[image + 1000] ^= 0x40
    found = bench.evaluate(bytes(broken))
    assert found.kind == "valid"
    assert "other than undamaged in pixels" in failure("protobuf", found, {"protobuf": whole.content})
    assert failure("bare-protobuf", found, {"bare-protobuf": whole.content}) == ""


def test_a_log_that_lost_its_class_table_is_refused_for_that(bench: Bench, logs: dict[str, bytes]) -> None:
    broken = bytearray(logs["ros2"])
    chunk = next(at for at in record_places(broken) if broken[at] == Opcode.CHUNK)
    broken[chunk + 200] ^= 1
    found = bench.evaluate(bytes(broken))
    assert found.kind == "refused"
    assert "no class table" in found.text
    assert "the log is damaged: chunk_" in found.text


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"kind": "crashed", "error": "KeyError", "text": "log.py:1 'x'"}, "traceback: KeyError at log.py:1 'x'"),
        ({"kind": "refused", "text": "two\nlines."}, "do not print"),
        ({"kind": "refused", "text": "no full stop"}, "no full stop"),
        ({"kind": "refused", "text": "It said ValueError('x')."}, "names an exception"),
        ({"seconds": 10.5}, "took 10.5 s"),
        ({"peak_bytes": 3 << 30}, "held 3.00 GiB"),
        ({"left_open": 1}, "left 1 files open"),
        ({"files": ("here/x",)}, "wrote here/x"),
        ({"kind": "lossy"}, ""),
    ],
)
def test_the_rules(change: dict[str, object], reason: str) -> None:
    found = failure("ours", replace(Outcome("valid", {"frames": 8}), **change), {"ours": {"frames": 8}})
    assert (reason in found) if reason else found == ""
    assert sentence_trouble("The log is empty; give another.") == ""


def test_what_is_written_beside_the_report_is_seen(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def careless(*, command: bool) -> Outcome:
        (tmp_path / "bench" / "out" / "report").mkdir()
        (tmp_path / "bench" / "home" / "x").write_text("")
        return Outcome("valid")

    monkeypatch.setattr(bench, "_report", careless)
    assert bench.evaluate(b"").files == ("home/x",)


def test_workers_outlive_their_tasks() -> None:
    """A process that hangs or dies is a failure of its mutant, and the others go on."""
    found = list(verdicts(impatient.work, [("die", 1), ("hang", 2), ("memory", 3), ("memory", 4)], 2, patience_s=2.0))
    assert sorted((v.log, v.seed, v.reason) for v in found) == [
        ("die", 1, "the process ended with 7"), ("hang", 2, "took more than 2 s"),
        ("memory", 3, "no memory"), ("memory", 4, "no memory"),
    ]  # fmt: skip
