"""The networks that can be built by name: one row each.

A name may end in a width, in sixteenths of the paper's channels: `pspnet-r18-sum-w4` has a quarter of them. Networks of
two streams take two: `pspnet-r18-sum-w4-w2`, colour first.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from stsem.errors import UsageError
from stsem.models.adapnet import AdapNet
from stsem.models.adapnet_pp import AdapNetPP
from stsem.models.bayesian_segnet import BayesianSegNet
from stsem.models.crf_rnn import CRFRNN
from stsem.models.deeplab import DeepLab
from stsem.models.fcn import FCN
from stsem.models.fusenet import FuseNet
from stsem.models.network import SegmentationNetwork
from stsem.models.parsenet import ParseNet
from stsem.models.resnet import ResNetSpec
from stsem.models.segnet import SegNet, SegNetBasic
from stsem.models.two_stream import FeatureFusion, OneStream, PredictionFusion, prediction_max, prediction_sum

SIXTEENTHS = 16


@dataclass(frozen=True)
class Paper:
    """Where a network is defined: authors and year, title, and the figure or section to read beside the code."""

    authors: str
    title: str
    figure: str


@dataclass(frozen=True)
class Row:
    """One network.

    Args:
        paper: its definition.
        build: called with the number of classes and a width factor for each of `widths`; random weights.
        widths: how many width factors there are.
    """

    paper: Paper
    build: Callable[..., SegmentationNetwork]
    widths: int = 1


_PSPNET = Paper("Zhao et al. 2016", "Pyramid Scene Parsing Network", "figure 3")
_FCN = Paper("Long et al. 2015", "Fully Convolutional Networks for Semantic Segmentation", "figure 3")
_PARSENET = Paper("Liu et al. 2015", "ParseNet: Looking Wider to See Better", "figure 1e")
_BAYESIAN = Paper("Kendall et al. 2015", "Bayesian SegNet", "figure 2")
_DEEPLAB = Paper("Chen et al. 2016", "DeepLab: Semantic Image Segmentation with Deep Convolutional Nets", "figure 7")
_CRF_RNN = Paper("Zheng et al. 2015", "Conditional Random Fields as Recurrent Neural Networks", "algorithm 1")
_ADAPNET = Paper(
    "Valada et al. 2017", "AdapNet: Adaptive Semantic Segmentation in Adverse Environmental Conditions", "section III"
)
_FUSENET = Paper("Hazirbas et al. 2016", "FuseNet: Incorporating Depth into Semantic Segmentation", "figure 2")


def _segnet(where: str) -> Paper:
    return Paper("Badrinarayanan et al. 2015", "SegNet: A Deep Convolutional Encoder-Decoder Architecture", where)


def _adapnet_pp(where: str) -> Paper:
    return Paper("Valada et al. 2019", "Self-Supervised Model Adaptation for Multimodal Semantic Segmentation", where)


def _paper(how: str) -> Paper:
    return Paper(
        "Li et al. 2018", "Semantic Scene Mapping with Spatio-temporal Deep Neural Network", f"figure 3, {how}"
    )


Backbone = Callable[[float], ResNetSpec]
"""A backbone of a width factor."""


def _spatial(backbone: Backbone, classes: int, width: float) -> OneStream:
    return OneStream(backbone(width), classes)


def _temporal(backbone: Backbone, classes: int, width: float) -> OneStream:
    return OneStream(backbone(width), classes, stream="difference")


def _two(
    make: Callable[..., SegmentationNetwork], backbone: Backbone, classes: int, *widths: float
) -> SegmentationNetwork:
    return make(*map(backbone, widths), classes)


def _pspnets(depth: int, *, deep_stem: bool = True) -> dict[str, Row]:
    fusions: dict[str, tuple[str, Callable[..., SegmentationNetwork]]] = {
        "sum": ("prediction SUM", partial(PredictionFusion, fuse=prediction_sum)),
        "max": ("prediction MAX", partial(PredictionFusion, fuse=prediction_max)),
        "feature-sum": ("feature map SUM", partial(FeatureFusion, join="sum")),
        "feature-concat": ("feature map concatenation", partial(FeatureFusion, join="concat")),
    }
    backbone = partial(ResNetSpec, depth, deep_stem=deep_stem)
    rows = {
        "spatial": Row(_PSPNET, partial(_spatial, backbone)),
        "temporal": Row(_paper("temporal stream"), partial(_temporal, backbone)),
    }
    rows |= {name: Row(_paper(how), partial(_two, make, backbone), 2) for name, (how, make) in fusions.items()}
    return {f"pspnet-r{depth}-{name}": row for name, row in rows.items()}


ZOO: dict[str, Row] = {
    **_pspnets(18), **_pspnets(50), **_pspnets(101),
    **{f"fcn-{stride}s": Row(_FCN, partial(FCN, stride=stride)) for stride in (32, 16, 8)},
    "parsenet": Row(_PARSENET, ParseNet),
    "segnet": Row(_segnet("figure 2"), SegNet),
    "segnet-basic": Row(_segnet("section 3.1"), SegNetBasic),
    "bayesian-segnet": Row(_BAYESIAN, BayesianSegNet),
    "deeplab-v2": Row(_DEEPLAB, DeepLab),
    "deeplab-v2-crf": Row(_DEEPLAB, partial(DeepLab, crf=True)),
    "crf-rnn": Row(_CRF_RNN, CRFRNN),
    "fusenet": Row(_FUSENET, FuseNet),
    "adapnet": Row(_ADAPNET, AdapNet),
    "adapnet-pp": Row(_adapnet_pp("figure 2"), AdapNetPP),
    "adapnet-pp-ssma": Row(_adapnet_pp("figures 2 and 5"), partial(AdapNetPP, inputs=("image", "depth"))),
}  # fmt: skip
ALIASES = {f"pspnet-r{depth}": f"pspnet-r{depth}-sum" for depth in (18, 50, 101)}
"""The paper's best fusion needs no name."""
PLAIN_STEMS = {
    f"{name}-7x7": row for depth in (18, 50, 101) for name, row in _pspnets(depth, deep_stem=False).items()
}  # fmt: skip
"""The same with one 7x7 convolution in front, as He et al. and torchvision have it, for weights of such a ResNet."""


def build(name: str, classes: int) -> SegmentationNetwork:
    """A network with random weights (torch's default initialisation; set the seed first).

    Args:
        name: a row of `ZOO` or `ALIASES`, with or without widths.
        classes: number of classes C.

    Raises:
        UsageError: there is no such row, or it takes fewer widths.
    """
    row, widths = find(name)
    return row.build(classes, *widths)


def find(name: str) -> tuple[Row, tuple[float, ...]]:
    """The row of a name, and its width factors. Raises UsageError as `build` does."""
    base, suffix = _NAME.fullmatch(name).groups()  # type: ignore[union-attr]  # it matches anything
    row = (ZOO | PLAIN_STEMS).get(ALIASES.get(base, base))
    if row is None:
        raise UsageError(f"There is no architecture {name!r}; choose one of {', '.join((*ALIASES, *ZOO))}, with -7x7 "
                         "behind a PSPNet for that stem, and -w4 at the end for 4/16 of the channels.")  # fmt: skip
    widths = tuple(int(part) / SIXTEENTHS for part in suffix.split("-w")[1:])
    if len(widths) > row.widths or 0.0 in widths:
        raise UsageError(f"The architecture {name!r} cannot be: {base} takes at most {row.widths} width(s), above 0.")
    return row, (widths or (1.0,)) * (row.widths if len(widths) < 2 else 1)


_NAME = re.compile(r"(.*?)((?:-w\d+)*)", re.DOTALL)
