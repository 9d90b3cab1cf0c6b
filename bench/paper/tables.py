"""The rows of the three tables: which cells are in them, and what the paper printed there.

Table 1's two headers are swapped in the paper (mean IoU cannot exceed pixel accuracy there), and Table 2's terrain of
the spatio-temporal row, printed 6.09, is 60.9 (the row then averages to the printed 71.1). Both are mended here.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from bench.paper.plan import Cell
from bench.paper.problem import DOSES

TABLES = ("table1", "table2", "table3")


@dataclass(frozen=True)
class Row:
    """One line of a table.

    Args:
        words: what the line is called.
        network: a name in `plan.NETWORKS`.
        paper: the paper's figures in per cent: mIoU and pixel accuracy in Table 1, mIoU in Table 2; in Table 3 the IoU
            of each class and mIoU. Empty where the paper has no such line.
    """

    words: str
    network: str
    paper: tuple[float, ...] = ()


CONTROL = "spatial"
"""The row that fused networks are compared with: trained on for as many views as they are."""

TABLE1 = (
    Row("spatial stream", "spatial-first", (88.91, 95.93)),
    Row("temporal stream", "temporal-first", (82.34, 94.12)),
    Row("spatial stream, trained on", CONTROL),
    Row("feature map concatenation", "feature-concat", (89.21, 96.30)),
    Row("feature map SUM", "feature-sum", (89.85, 96.46)),
    Row("prediction MAX", "max", (89.46, 96.46)),
    Row("prediction SUM", "sum", (90.68, 96.74)),
)
TABLE2 = (
    Row("FCN-32s", "fcn-32s"),
    Row("FCN-16s", "fcn-16s"),
    Row("FCN-8s", "fcn-8s", (65.3,)),
    Row("CRF-RNN", "crf-rnn", (62.5,)),
    Row("ParseNet", "parsenet", (66.8,)),
    Row("SegNet", "segnet"),
    Row("SegNet-Basic", "segnet-basic"),
    Row("Bayesian SegNet", "bayesian-segnet"),
    Row("DeepLab v2", "deeplab-v2"),
    Row("DeepLab v2, CRF", "deeplab-v2-crf", (70.4,)),
    Row("AdapNet", "adapnet"),
    Row("AdapNet++", "adapnet-pp"),
    Row("AdapNet++ SSMA (RGB-D)", "adapnet-pp-ssma"),
    Row("FuseNet (RGB-D)", "fusenet"),
    Row("spatial PSPNet (ResNet-18)", CONTROL),
    Row("spatio-temporal (ResNet-18)", "sum"),
    Row("spatial PSPNet (ResNet-50)", "spatial-r50", (70.0,)),
    Row("spatio-temporal (ResNet-50)", "sum-r50", (71.1,)),
)
TABLE3 = (
    Row("spatial stream", "spatial-first",
        (90.27, 89.21, 98.95, 70.30, 95.30, 87.19, 89.69, 91.17, 81.26, 79.90, 88.22, 70.27, 97.76, 86.88)),
    Row("temporal stream", "temporal-first",
        (89.92, 87.05, 90.49, 57.24, 75.55, 83.26, 77.35, 79.85, 81.39, 84.62, 87.99, 73.30, 93.76, 81.67)),
    Row("spatial stream, trained on", CONTROL),
    Row("spatio-temporal, prediction SUM", "sum",
        (95.45, 89.97, 96.26, 64.18, 91.42, 94.72, 88.33, 93.33, 93.74, 90.10, 93.10, 83.26, 98.83, 90.21)),
)  # fmt: skip
WRONG = DOSES[1:]


def cells_of(table: str, seeds: int, *, depth: bool = True) -> Iterator[Cell]:
    """The cells of a table's lines, without those that they start from.

    Args:
        table: of `TABLES`.
        seeds: how many; Table 2 has one.
        depth: whether the data has depth for the networks that need it.
    """
    if table == "table2":
        yield from (Cell(row.network, "right", 0) for row in TABLE2 if depth or "RGB-D" not in row.words)
        return
    for seed in range(seeds):
        if table == "table1":
            yield from (Cell(row.network, "right", seed) for row in TABLE1)
        else:
            yield from (Cell(row.network, dose, seed) for dose in DOSES for row in TABLE3)
