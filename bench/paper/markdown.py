"""The tables as Markdown: one function a table, from results."""

import math
from collections.abc import Callable, Iterable, Sequence

from bench.paper.plan import Cell
from bench.paper.problem import DOSES
from bench.paper.results import Results, accuracy
from bench.paper.statistics import Comparison, Spread
from bench.paper.tables import CONTROL, TABLE1, TABLE2, TABLE3, WRONG, Row

NOTHING = "-"
DIGITS = 12
FUSIONS = tuple(row for row in TABLE1 if row.network in ("sum", "max", "feature-sum", "feature-concat"))
CLASSES_IN_TABLE3 = 13
LABELS = {"right": "right", "one": "one image wrong", "tenth": "a tenth wrong"}


def table1(found: Results) -> str:
    """Ways to fuse: mIoU and pixel accuracy beside the paper's, and the questions."""
    lines = [
        [row.words, _spread(found.spread(row.network)), _spread(found.spread(row.network, measure=accuracy)),
         *(_paper(row, place, 2) for place in range(2)), _seeds(found, row, "right")]
        for row in TABLE1
    ]  # fmt: skip
    head = ["network", "mIoU", "pixel accuracy", "paper: mIoU", "paper: pixel accuracy", "seeds"]
    asked = [(f"{row.words} better than spatial, trained on", found.comparison((row.network, "right"), _RIGHT))
             for row in FUSIONS]  # fmt: skip
    asked += [(f"prediction SUM better than {row.words}", found.comparison(("sum", "right"), (row.network, "right")))
              for row in FUSIONS if row.network != "sum"]  # fmt: skip
    streams = found.comparison(("spatial-first", "right"), ("temporal-first", "right"))
    return _table(head, lines) + "\n\n" + questions([*asked, ("spatial better than temporal stream", streams)])


def table2(found: Results) -> str:
    """IoU of each class for every network, one seed."""
    lines = []
    for row in TABLE2:
        means, whole = found.class_means(row.network, seeds=[0]), found.values(row.network, "right")
        if 0 in whole:
            lines.append([row.words, *map(_number, means), f"**{_number(whole[0])}**", _paper(row, 0, 1)])
    return _table(["network", *found.classes, "mIoU", "paper, Cityscapes"], lines)


def table3(found: Results) -> str:
    """The "problem" set: IoU of each class at each dose, the paper's, the questions and the neighbour."""
    lines = [
        [LABELS[dose], row.words, *map(_number, found.class_means(row.network, dose)),
         _spread(found.spread(row.network, dose))]
        for dose in DOSES for row in TABLE3 if found.spread(row.network, dose)
    ]  # fmt: skip
    if len(found.classes) == CLASSES_IN_TABLE3:
        lines += [["paper", row.words, *map(_number, row.paper)] for row in TABLE3 if row.paper]
    whole = _table(["labels", "network", *found.classes, "mIoU"], lines)
    asked = [
        (f"{LABELS[dose]}: fused better than spatial, trained on", found.comparison(("sum", dose), (CONTROL, dose)))
        for dose in WRONG
    ]
    asked += [(f"{LABELS[dose]}: fused loses less than spatial, trained on", found.robustness("sum", CONTROL, dose))
              for dose in WRONG]  # fmt: skip
    return f"{whole}\n\n{questions(asked)}\n\n{_neighbours(found)}"


def cells(found: Results) -> str:
    """Every cell with the hashes of its weights."""
    lines = []
    for (network, dose), of_seed in sorted(found.of.items()):
        first = next(iter(of_seed.values()))
        hashes = ", ".join(f"{of_seed[seed]['weights_sha256'][:DIGITS]}" for seed in sorted(of_seed))
        name = Cell(network, dose, 0).key.partition("/")[0]
        lines.append([f"`{name}`", first["architecture"], str(first["recipe"]["iterations"]),
                      ", ".join(first["starts"].values()).replace("/0", "") or NOTHING, hashes])  # fmt: skip
    data = next(iter(next(iter(found.of.values())).values()))
    pixels = "\n".join(f"- {which}: {data['pairs'][which]} pairs, pixels sha256 `{digest}`"
                       for which, digest in data["data_sha256"].items())  # fmt: skip
    where = ", ".join(sorted({f"{r['host']['machine']}, torch {r['host']['torch']}"
                              for of_seed in found.of.values() for r in of_seed.values()}))  # fmt: skip
    table = _table(["cell", "architecture", "iterations", "starts from", "weights, by seed"], lines)
    return f"{pixels}\n- problem image: `{data['problem_image']}`\n- machine: {where}\n\n{table}"


PARTS: dict[str, Callable[[Results], str]] = {"table1": table1, "table2": table2, "table3": table3, "cells": cells}
_RIGHT = (CONTROL, "right")


def questions(asked: Iterable[tuple[str, Comparison | None]]) -> str:
    """A line for each question with its answer by the rule."""
    lines = [[words, *_answer(found)] for words, found in asked if found is not None]
    return _table(["question", "difference, points", "95 % margin", "answer"], lines)


def _answer(found: Comparison) -> tuple[str, str, str]:
    if found.margin is None:
        return f"{found.spread.mean:+.2f}", NOTHING, "one seed: not judged"
    words = ("yes" if found.spread.mean > 0 else "no, worse") if found.called else "not beyond the spread"
    return f"{found.spread.mean:+.2f}", f"± {found.margin:.2f}", words


def _neighbours(found: Results) -> str:
    lines = []
    for row in TABLE3:
        shares = [found.neighbour(row.network, dose) for dose in DOSES]
        lines.append([row.words, *(NOTHING if s is None else f"{s[0]:.1f} / {s[1]:.1f}" for s in shares)])
    return _table(["neighbour's floor called floor / lamp, %", *(LABELS[dose] for dose in DOSES)], lines)


def _seeds(found: Results, row: Row, dose: str) -> str:
    return str(len(found.of.get((row.network, dose), {})))


def _spread(value: Spread | None) -> str:
    if value is None:
        return NOTHING
    return f"{value.mean:.2f}" if value.deviation is None else f"{value.mean:.2f} ± {value.deviation:.2f}"


def _paper(row: Row, place: int, digits: int) -> str:
    """As the paper prints it."""
    return f"{row.paper[place]:.{digits}f}" if row.paper else NOTHING


def _number(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.1f}"


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)
