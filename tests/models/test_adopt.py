"""Networks from elsewhere: whatever form they have, the labels are those of the same network in numpy."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnxruntime
import pytest

onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from onnx import TensorProto, helper, numpy_helper

from stsem.classes import NO_LABEL, ClassSet
from stsem.errors import NetworkError
from stsem.frame import Frame
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import load_network
from stsem.inference.sidecar import Sidecar, render
from stsem.models.adopt import Told, adopt

WIDTH, HEIGHT, CLASSES = 24, 16, 5
SIZE, IMAGE = (WIDTH, HEIGHT), {"image": 3}
WEIGHTS = np.random.default_rng(0).normal(size=(CLASSES, 3, 1, 1)).astype(np.float32)
FLOATS = {TensorProto.FLOAT: np.float32, TensorProto.FLOAT16: np.float16}


def foreign(
    path: Path, *, shape: tuple[int | str, ...] = (1, 3, HEIGHT, WIDTH), kind: int = TensorProto.FLOAT,
    nhwc: bool = False, name: str = "image", last: tuple[Any, ...] = (), opset: int = 17, stated: bool = True,
    out: tuple[int, tuple[Any, ...]] | None = None, more: tuple[str, ...] = (),
) -> Path:  # fmt: skip
    """Five scores a pixel: 8 times a 1x1 convolution of the image (0 to 1), under names that collide with ours.

    `last` are further nodes, `(kind, attributes)` each, between the scores and the output `labels`.
    """
    inside = kind if kind in FLOATS else TensorProto.FLOAT
    nodes, constants, at = [], [numpy_helper.from_array(WEIGHTS.astype(FLOATS[inside]) * 8, "w")], name
    if inside != kind:
        nodes.append(helper.make_node("Cast", [at], ["wide"], to=inside))
        nodes.append(helper.make_node("Div", ["wide", "levels"], ["unit"]))
        levels = 255 if kind == TensorProto.UINT8 else 1
        constants.append(numpy_helper.from_array(np.asarray(levels, np.float32), "levels"))
        at = "unit"
    if len(shape) == 3:
        constants.append(numpy_helper.from_array(np.asarray([1, *shape]), "full"))
        nodes.append(helper.make_node("Reshape", [at, "full"], ["batched"]))
        at = "batched"
    if nhwc:
        nodes.append(helper.make_node("Transpose", [at], ["first"], perm=[0, 3, 1, 2]))
        at = "first"
    nodes.append(helper.make_node("Conv", [at, "w"], ["confidence"]))
    at = "confidence"
    for i, (what, attributes) in enumerate(last):
        nodes.append(helper.make_node(what, [at], [f"step{i}"], **attributes))
        at = f"step{i}"
    nodes.append(helper.make_node("Identity", [at], ["labels"]))
    kept = out or (inside, (1, CLASSES, HEIGHT, WIDTH))
    graph = helper.make_graph(
        nodes, "net", [helper.make_tensor_value_info(name, kind, shape),
                       *(helper.make_tensor_value_info(x, TensorProto.FLOAT, [1]) for x in more)],
        [helper.make_tensor_value_info("labels", kept[0], kept[1] if stated else None)], constants,
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def image() -> np.ndarray:
    """(1, 3, H, W) in 0 to 1, in steps of 1/255."""
    smooth = cv2.resize(np.random.default_rng(1).random((5, 7, 3)).astype(np.float32), SIZE)
    return np.rint(smooth.clip(0, 1) * 255).astype(np.float32).transpose(2, 0, 1)[None] / np.float32(255)


def probabilities(bgr: bool = False) -> np.ndarray:
    """(C, H, W) by numpy."""
    scores = 8 * np.einsum("kc,chw->khw", WEIGHTS[..., 0, 0], image()[0][::-1] if bgr else image()[0])
    scores = np.exp(scores - scores.max(0))
    return scores / scores.sum(0)


def run(path: Path, scale: float = 1) -> tuple[np.ndarray, np.ndarray]:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    labels, confidence = session.run(["labels", "confidence"], {"image": image() * np.float32(scale)})
    assert labels.shape == confidence.shape == (1, HEIGHT, WIDTH)
    assert (labels.dtype in (np.uint8, np.int64), confidence.dtype) == (True, np.float32)
    return labels[0], confidence[0]


def adopted(path: Path, told: Told | None = None, **changed: Any) -> tuple[Path, list[str]]:
    out = path.with_name("out.onnx")
    how: dict[str, Any] = {"size": SIZE, "classes": CLASSES, "inputs": IMAGE, "metadata": {}, **changed}
    return out, adopt(path, out, told or Told(), **how)


OPEN = ("batch", 3, "height", "width")
LAST = (1, HEIGHT, WIDTH, 3)
TO_LAST = (("Transpose", {"perm": [0, 2, 3, 1]}),)
SCORES: dict[str, tuple[dict[str, Any], Told, str]] = {
    "scores": ({}, Told(), "image as 'image', float32 (1, 3, 16, 24)"),
    "other name": ({"name": "pixel_values"}, Told(), "image as 'pixel_values'"),
    "open sides": ({"shape": OPEN, "stated": False}, Told(), "scores, softmax added"),
    "no batch": ({"shape": (3, HEIGHT, WIDTH)}, Told(), "float32 (3, 16, 24)"),
    "channels last": ({"shape": LAST, "nhwc": True}, Told(), "(1, 16, 24, 3)"),
    "all last": ({"shape": LAST, "nhwc": True, "last": TO_LAST, "out": (1, (1, HEIGHT, WIDTH, CLASSES))}, Told(),
                 "(1, 16, 24, 5)"),
    "last and open": ({"shape": (1, "h", "w", "c"), "nhwc": True}, Told(layout="nhwc"), "(1, 16, 24, 3)"),
    "half": ({"kind": TensorProto.FLOAT16}, Told(), "float16"),
    "double": ({"kind": TensorProto.DOUBLE}, Told(), "float64"),
    "old opset": ({"opset": 9}, Told(), "scores"),
    "new opset": ({"opset": 21}, Told(), "scores"),
    "softmax inside": ({"last": (("Softmax", {"axis": 1}),)}, Told(), ": probabilities"),
    "named": ({"name": "x"}, Told({"image": "x"}, "labels"), "'labels', float32"),
}  # fmt: skip


@pytest.mark.parametrize("case", SCORES)
def test_scores_in_any_form(tmp_path: Path, case: str) -> None:
    """Labels and confidence of the softmax, and a line that says what was found."""
    how, told, line = SCORES[case]
    out, found = adopted(foreign(tmp_path / "net.onnx", **how), told)
    labels, confidence = run(out)
    expected = probabilities()
    loose = case == "half"
    assert (labels == expected.argmax(0)).mean() > (0.98 if loose else 0.9999)
    assert np.allclose(confidence, expected.max(0), atol=2e-2 if loose else 1e-5)
    assert any(line in text for text in found), found
    assert len(set(labels.flat)) > 1


def test_blue_first(tmp_path: Path) -> None:
    out, _ = adopted(foreign(tmp_path / "net.onnx"), Told(bgr=True))
    assert np.array_equal(run(out)[0], probabilities(bgr=True).argmax(0))


def test_eight_bits(tmp_path: Path) -> None:
    """The sidecar's std of 1/255 gives 0 to 255; what is a little below a level is rounded, not cut."""
    out, found = adopted(foreign(tmp_path / "net.onnx", kind=TensorProto.UINT8))
    assert np.array_equal(run(out, 254.9999)[0], probabilities().argmax(0))
    assert "uint8" in found[0]


def test_scores_of_a_quarter_are_enlarged(tmp_path: Path) -> None:
    """Probabilities, bilinear with the centres of pixels aligned: as OpenCV does."""
    pool = ("AveragePool", {"kernel_shape": [4, 4], "strides": [4, 4]})
    out, found = adopted(foreign(tmp_path / "net.onnx", last=(pool,), out=(1, (1, CLASSES, 4, 6))))
    scores = 8 * np.einsum("kc,chw->khw", WEIGHTS[..., 0, 0], image()[0]).reshape(CLASSES, 4, 4, 6, 4).mean((2, 4))
    scores = np.exp(scores - scores.max(0))
    small = scores / scores.sum(0)
    full = np.stack([cv2.resize(plane, SIZE, interpolation=cv2.INTER_LINEAR) for plane in small])
    labels, confidence = run(out)
    assert (labels == full.argmax(0)).mean() > 0.99
    assert np.allclose(confidence, full.max(0), atol=1e-5)
    assert found[-1].endswith("softmax added, enlarged")


@pytest.mark.parametrize(("kept", "kind"), [(1, TensorProto.INT64), (0, TensorProto.INT32), (1, TensorProto.UINT8)])
def test_labels_of_any_whole_type(tmp_path: Path, kept: int, kind: int) -> None:
    """With or without a side of one; there is no confidence."""
    shape = (1, 1, HEIGHT, WIDTH) if kept else (1, HEIGHT, WIDTH)
    last = (("ArgMax", {"axis": 1, "keepdims": kept}), ("Cast", {"to": kind}))
    out, found = adopted(foreign(tmp_path / "net.onnx", last=last, out=(kind, shape)))
    labels, confidence = run(out)
    assert np.array_equal(labels, probabilities().argmax(0))
    assert (confidence == 1).all()
    assert "labels; their confidence is not known" in found[-1]


@pytest.mark.parametrize(("kind", "offset"), [(TensorProto.INT64, 256), (TensorProto.INT32, 512),
                                              (TensorProto.UINT8, 100), (TensorProto.INT16, -9)])  # fmt: skip
def test_ids_beyond_the_classes_are_refused(tmp_path: Path, kind: int, offset: int) -> None:
    """In 8 bits 256 would be class 0; below 0 is no label, whatever the number."""
    last = (("ArgMax", {"axis": 1, "keepdims": 0}), ("Cast", {"to": kind}))
    path = foreign(tmp_path / "net.onnx", last=last, out=(kind, (1, HEIGHT, WIDTH)))
    model = onnx.load(path)
    model.graph.node[-1].CopyFrom(helper.make_node("Add", [model.graph.node[-1].input[0], "offset"], ["labels"]))
    model.graph.initializer.append(helper.make_tensor("offset", kind, [], [offset]))
    onnx.save(model, path)
    out, _ = adopted(path)
    sidecar = Sidecar(SIZE, (0.0,) * 3, (1.0,) * 3, ClassSet(tuple("abcde")))
    out.with_suffix(".toml").write_text(render(sidecar))
    seen = Frame(0, 0, np.full((HEIGHT, WIDTH, 3), 99, np.uint8))
    network = Inferencer(load_network(out), threads=1)
    if offset < 0:
        assert (network.infer(seen).labels == NO_LABEL).all()
    else:
        with pytest.raises(NetworkError, match=rf"returned class {offset // 10}\d, but its sidecar names 5 classes"):
            network.infer(seen)


def test_small_labels_are_enlarged_by_the_nearest(tmp_path: Path) -> None:
    last = (("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2]}), ("ArgMax", {"axis": 1, "keepdims": 0}))
    out, _ = adopted(foreign(tmp_path / "net.onnx", last=last, out=(TensorProto.INT64, (1, HEIGHT // 2, WIDTH // 2))))
    labels, _ = run(out)
    assert np.array_equal(labels, labels[::2, ::2].repeat(2, 0).repeat(2, 1))
    assert len(set(labels.flat)) > 1


def test_two_inputs(tmp_path: Path) -> None:
    """Each by its name; the difference comes in as it is."""
    nodes = [helper.make_node("Add", ["a", "b"], ["sum"]), helper.make_node("Conv", ["sum", "w"], ["scores"])]
    graph = helper.make_graph(
        nodes, "net", [helper.make_tensor_value_info(x, TensorProto.FLOAT, OPEN) for x in "ab"],
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, None)], [numpy_helper.from_array(WEIGHTS, "w")],
    )  # fmt: skip
    path = tmp_path / "net.onnx"
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)
    both = {"image": 3, "difference": 3}
    with pytest.raises(
        NetworkError, match=r"no input 'image' for the image, but 'a', 'b'; name it with --input image="
    ):
        adopted(path, inputs=both)
    with pytest.raises(NetworkError, match=r"also has the input 'b', and the sidecar calls for image alone"):
        adopted(path, Told({"image": "a"}))
    out, _ = adopted(path, Told({"image": "a", "difference": "b"}), inputs=both)
    session = onnxruntime.InferenceSession(str(out), providers=["CPUExecutionProvider"])
    assert [x.name for x in session.get_inputs()] == ["image", "difference"]
    labels, _ = session.run(None, {"image": image(), "difference": image()[..., ::-1].copy()})
    total = image()[0] + image()[0][..., ::-1]
    assert (labels[0] == np.einsum("kc,chw->khw", WEIGHTS[..., 0, 0], total).argmax(0)).mean() > 0.99


REFUSED: dict[str, tuple[dict[str, Any], Told, dict[str, Any], str]] = {
    "19 classes": ({}, Told(), {"classes": 19}, "'labels', float32 (1, 5, 16, 24) has no side for the 19 classes"),
    "size": ({}, Told(), {"size": (32, 16)}, "the sidecar's size calls for (1, 3, 16, 32); write"),
    "layout": ({"shape": ("n", "c", "h", "w")}, Told(), {}, "does not tell where its 3 channel(s)"),
    "type": ({"kind": TensorProto.INT64}, Told(), {}, "is of type int64; it must be one of float32"),
    "another input": ({"more": ("training",)}, Told(), {}, "also has the input 'training'"),
    "no such role": ({}, Told({"imgae": "image"}), {}, "calls for image and not for 'imgae', which --input names"),
    "no such input": ({}, Told({"image": "pixels"}), {}, "no input 'pixels' for the image, but 'image'"),
    "no such output": ({}, Told(output="out"), {}, "no output 'out': 'labels'; choose one with --output"),
    "depth": ({}, Told(), {"inputs": {"image": 3, "depth": 1}}, "no input 'depth' for the depth, but 'image'"),
    "float labels": ({"last": (("ArgMax", {"axis": 1}), ("Cast", {"to": 1})), "out": (1, (1, 1, HEIGHT, WIDTH))},
                     Told(), {}, "(1, 1, 16, 24) has no side for the 5 classes"),
    "not for this size": ({"shape": OPEN, "stated": False, "last": (("SpaceToDepth", {"blocksize": 7}),)},
                          Told(), {}, "fails on an image of the sidecar's size"),
    "flags": ({"last": (("IsNaN", {}),), "out": (TensorProto.BOOL, (1, CLASSES, HEIGHT, WIDTH))}, Told(),
              {}, "neither"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_adopted(tmp_path: Path, case: str) -> None:
    """One sentence; nothing is written."""
    how, told, changed, sentence = REFUSED[case]
    with pytest.raises(NetworkError) as caught:
        adopted(foreign(tmp_path / "net.onnx", **how), told, **changed)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "given/" not in str(caught.value)
    assert not (tmp_path / "out.onnx").exists()


@pytest.mark.parametrize("spoil", [lambda p: p.write_bytes(b""), lambda p: p.write_text("text"), Path.unlink,
                                   lambda p: p.write_bytes(p.read_bytes()[:99]),
                                   lambda p: p.write_bytes(p.read_bytes().replace(b"Conv", b"\xffonv")),
                                   lambda p: p.write_bytes(p.read_bytes().replace(b"image", b"im\xffge"))])  # fmt: skip
def test_files_that_are_no_networks(tmp_path: Path, spoil: Callable[[Path], object]) -> None:
    path = foreign(tmp_path / "net.onnx")
    spoil(path)
    with pytest.raises(NetworkError, match=r"no ONNX file|cannot be read|fails on|damaged"):
        adopted(path)


def test_the_same_bytes_again(tmp_path: Path) -> None:
    out, _ = adopted(foreign(tmp_path / "net.onnx"))
    first = out.read_bytes()
    assert adopted(foreign(tmp_path / "net.onnx"))[0].read_bytes() == first
