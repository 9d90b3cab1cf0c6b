"""What every cell needs to know of its data, found once: what its pixels are, and where the problem is."""

import json
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path

from bench.paper.data import SETS, Data
from bench.paper.problem import Problem
from stsem.aside import aside
from stsem.train.dataset import Pairs


@dataclass(frozen=True)
class Facts:
    """Of one data set.

    Args:
        sha256: of the pixels of each set.
        pairs: how many there are in each.
        problem: of the training set.
        image: name of the problem pair.
    """

    sha256: dict[str, str]
    pairs: dict[str, int]
    problem: Problem
    image: str


def facts_of(data: Data, out: Path) -> Facts:
    """The facts of prepared data, from `out` if they were found for these pairs before."""
    path, sets = out / f"facts-{data.name}.json", _sets(data)
    known = {which: pairs.fingerprint for which, pairs in sets.items()}
    if path.is_file():
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["of"] == known:
            problem = kept["problem"] | {"others": frozenset(kept["problem"]["others"])}
            return Facts(kept["sha256"], kept["pairs"], Problem(**problem), kept["image"])
    problem = data.problem()
    facts = Facts(
        {which: pixels_sha256(pairs) for which, pairs in sets.items()},
        {which: len(pairs) for which, pairs in sets.items()}, problem, data.names()[problem.pair],
    )  # fmt: skip
    kept = {"of": known} | asdict(facts) | {"problem": asdict(problem) | {"others": sorted(problem.others)}}
    out.mkdir(parents=True, exist_ok=True)
    unfinished = aside(path)
    unfinished.write_text(json.dumps(kept), encoding="utf-8")
    unfinished.replace(path)
    return facts


def _sets(data: Data) -> dict[str, Pairs]:
    return {which: data.pairs(which) for which in SETS if (data.folder / which).is_dir()}


def pixels_sha256(pairs: Pairs) -> str:
    """Of all images, labels and depths, in their order, however they lie on disk."""
    digest = sha256()
    for index in range(len(pairs)):
        pair = pairs.pair(index)
        for array in (pair.images, pair.labels, pair.depths):
            digest.update(b"none" if array is None else array.tobytes())
    return digest.hexdigest()
