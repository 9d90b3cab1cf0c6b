"""Loading a network: what is described, and one clear sentence for what cannot be."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from stsem.errors import NetworkError
from stsem.inference.network import OutputKind, load_network

Files = Callable[..., Path]
SIDECAR = 'size = [16, 12]\nmean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\nclasses = ["red", "green", "blue"]\n'
WITH_DIFFERENCE = SIDECAR + "[difference]\nscale = 2.0\n"


def test_a_network_describes_itself(files: Files) -> None:
    """Size, classes, difference, kind of output and the sums of both files."""
    path = files("difference", WITH_DIFFERENCE)
    network = load_network(path)
    assert (network.name, network.size, network.has_difference) == ("net", (16, 12), True)
    assert network.classes.names == ("red", "green", "blue")
    assert network.output is OutputKind.LABELS
    assert network.model_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert load_network(files("logits")).output is OutputKind.LOGITS
    assert load_network(files("wide labels")).output is OutputKind.LABELS


def test_the_fingerprint_covers_both_files(files: Files) -> None:
    """Another mean is another network, though the ONNX file is the same."""
    one, other = load_network(files()), load_network(files(sidecar=SIDECAR.replace("mean = [0.0", "mean = [0.1")))
    assert one.model_sha256 == other.model_sha256
    assert one.sha256 != other.sha256


def test_a_network_with_depth(files: Files) -> None:
    """One channel, and a section of its own."""
    network = load_network(files("depth", SIDECAR + "[depth]\n"))
    assert (network.has_depth, network.has_difference) == (True, False)
    assert network.sidecar.inputs == ("image", "depth")
    assert not load_network(files()).has_depth


@pytest.mark.parametrize(
    ("kind", "sidecar", "metadata", "part"),
    [
        ("labels", None, {}, "has no sidecar net.toml"),
        ("labels", WITH_DIFFERENCE, {}, "has the inputs 'image', but its sidecar calls for 'difference', 'image'"),
        ("difference", SIDECAR, {}, "has the inputs 'difference', 'image', but its sidecar calls for 'image'"),
        ("depth", SIDECAR, {}, "has the inputs 'depth', 'image', but its sidecar calls for 'image'; the sections"),
        ("depth", WITH_DIFFERENCE + "[depth]\n", {}, "its sidecar calls for 'depth', 'difference', 'image'"),
        ("other input", SIDECAR, {}, "has the inputs 'input'"),
        ("other output", SIDECAR, {}, "has the outputs 'out'; expected 'labels' and 'confidence', or 'logits'"),
        ("wide labels", SIDECAR.replace("16, 12", "12, 16"), {}, "'image' as tensor(float) of shape (1, 3, 12, 16)"),
        ("labels", SIDECAR.replace("16, 12", "12, 16"), {}, "(1, 3, 16, 12) is expected"),
        ("logits", SIDECAR.replace(', "blue"', ""), {}, "(1, 2, any, any) is expected"),
        ("labels", SIDECAR, {"stsem.class_count": "13"}, "tells 13 classes apart, but its sidecar names 3"),
        ("labels", SIDECAR + "sixe = 1\n", {}, "did you mean 'size'"),
    ],
)
def test_a_network_that_cannot_be(
    files: Files, kind: str, sidecar: str | None, metadata: dict[str, str], part: str
) -> None:
    """The message says what came and what was expected."""
    with pytest.raises(NetworkError) as caught:
        load_network(files(kind, sidecar, metadata))
    assert part in str(caught.value)


def test_a_file_that_is_not_onnx(tmp_path: Path) -> None:
    """Bytes that are no graph, and an empty file."""
    path = tmp_path / "net.onnx"
    path.with_suffix(".toml").write_text(SIDECAR)
    for content in (b"\x89PNG\r\n\x1a\n" + bytes(100), b""):
        path.write_bytes(content)
        with pytest.raises(NetworkError, match=r"net\.onnx"):
            load_network(path)


def test_a_missing_file_and_an_unknown_name(tmp_path: Path) -> None:
    """A suffix .onnx means a file; anything else is a name, and the known ones are listed."""
    with pytest.raises(NetworkError, match="There is no network file"):
        load_network(tmp_path / "none.onnx")
    with pytest.raises(NetworkError, match="The oracle is the truth of a log and has no file"):
        load_network("oracle")  # as `stsem quantize oracle` would
    with pytest.raises(NetworkError, match=r"There is no network 'defualt'.*oracle"):
        load_network("defualt")


def test_a_sidecar_that_is_not_text(files: Files) -> None:
    """Bytes outside UTF-8 are named as such."""
    path = files()
    path.with_suffix(".toml").write_bytes(b"size = \xff\xfe")
    with pytest.raises(NetworkError, match="not UTF-8"):
        load_network(path)
