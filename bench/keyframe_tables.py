"""Tables and a figure of what `bench.keyframes` measured.

    python -m bench.keyframe_tables RESULTS.jsonl [--figure docs/images/keyframes.png]

A table for each log and model: a row per policy, a column per method, `keyframes: mIoU (gain over the twin)`. The twin
is the fixed interval with as many keyframes, linear between the two intervals around it.
"""

import argparse
import re
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import numpy as np

from bench.keyframes import Cell, read

matplotlib.use("agg")
from matplotlib import pyplot as plt

KINDS = {
    "every": "fixed interval",
    "paper": "paper's rule",
    "coverage": "coverage",
    "budget": "budget",
    "moved": "",
    "covered": "",
}


def kind(cell: Cell) -> str:
    return re.split(r"[:*/]", cell.policy)[0]


def group(cells: Iterable[Cell], **wanted: object) -> list[Cell]:
    """The cells with these fields, fewest keyframes first."""
    found = [cell for cell in cells if all(getattr(cell, name) == value for name, value in wanted.items())]
    return sorted(found, key=lambda cell: cell.cost)


def twin(cells: list[Cell], cell: Cell) -> float | None:
    """mIoU of the fixed interval at the cost of `cell`; None outside what was measured."""
    fixed = [one for one in group(cells, log=cell.log, model=cell.model, method=cell.method, partial=0.0)
             if kind(one) == "every"]  # fmt: skip
    costs = [one.cost for one in fixed]
    if not costs or not costs[0] <= cell.cost <= costs[-1]:
        return None
    return float(np.interp(cell.cost, costs, [one.miou for one in fixed]))


def written(cells: list[Cell], cell: Cell | None) -> str:
    if cell is None:
        return "-"
    equal = twin(cells, cell)
    gain = "" if kind(cell) == "every" or equal is None else f" ({100 * (cell.miou - equal):+.1f})"
    return f"{cell.keyframes}: {100 * cell.miou:.1f}{gain}"


def table(cells: list[Cell], log: str, model: str) -> list[str]:
    some = [cell for cell in cells if (cell.log, cell.model, cell.partial) == (log, model, 0.0)]
    methods, policies = (list(dict.fromkeys(getattr(cell, name) for cell in some)) for name in ("method", "policy"))
    policies.sort(key=lambda name: list(KINDS).index(re.split(r"[:*/]", name)[0]))
    by_key = {(cell.policy, cell.method): cell for cell in some}
    rows = [f"| {policy} | " + " | ".join(written(cells, by_key.get((policy, method))) for method in methods) + " |"
            for policy in policies]  # fmt: skip
    head = [f"`{log}`, {model}, {some[0].frames} frames", "", f"| policy | {' | '.join(methods)} |"]
    return [*head, "|---" * (len(methods) + 1) + "|", *rows, ""]


def partial_table(cells: list[Cell]) -> list[str]:
    rows = [
        f"| {cell.log} | {cell.method} | {cell.policy} | {cell.partial:g} | {cell.keyframes} + {cell.crops} | "
        f"{cell.cost:.3f} | {100 * cell.miou:.1f} | "
        f"{'-' if (equal := twin(cells, cell)) is None else f'{100 * equal:.1f}'} |"
        for cell in cells
        if cell.partial
    ]
    head = "| log | method | policy | crop below | keyframes + crops | networks a frame | mIoU | fixed interval there |"
    return [head, "|---" * 8 + "|", *rows] if rows else []


def figure(cells: list[Cell], path: Path) -> None:
    """mIoU over the share of frames segmented, by the oracle: a column per log, a row per method."""
    some = [cell for cell in cells if cell.model == "oracle" and not cell.partial]
    logs, methods = (list(dict.fromkeys(getattr(cell, name) for cell in some)) for name in ("log", "method"))
    drawn, axes = plt.subplots(len(methods), len(logs), figsize=(3 * len(logs), 2.1 * len(methods)), squeeze=False)
    for row, method in zip(axes, methods, strict=True):
        for panel, log in zip(row, logs, strict=True):
            panel.set_visible(bool(group(some, log=log, method=method)))
            for place, (name, label) in enumerate(KINDS.items()):
                line = [
                    cell
                    for cell in group(some, log=log, method=method)
                    if kind(cell) == name and label and cell.cost <= 0.5
                ]
                if line:
                    panel.plot(
                        [100 * c.cost for c in line], [100 * c.miou for c in line], f"C{place}.-", lw=1, label=label
                    )
            panel.set_title(f"{log.removeprefix('keys-')}, {method}", fontsize=8)
            panel.tick_params(labelsize=7)
    axes[0, 0].legend(fontsize=7)
    axes[-1, 0].set_xlabel("frames segmented, %", fontsize=8)
    axes[-1, 0].set_ylabel("mIoU", fontsize=8)
    drawn.tight_layout()
    drawn.savefig(path, dpi=70, metadata={"Software": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    cells = list(read(given.results).values())
    for log, model in dict.fromkeys((cell.log, cell.model) for cell in cells):
        print("\n".join(table(cells, log, model)))
    print("\n".join(partial_table(cells)))
    if given.figure:
        figure(cells, given.figure)


if __name__ == "__main__":
    main()
