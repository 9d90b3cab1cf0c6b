"""Network outputs kept on disk: the same frame through the same network costs nothing the second time.

Layout: `<root>/outputs/<key>/<stamp_ns>.seg`, one file per frame, beside an `about.json` that says what the key stands
for. An entry is a header, the zlib-packed labels, confidence and maps of uncertainty, and their checksum. It also holds
a checksum of the pixels that went in, so that two cameras of one log under one stamp are never confused. Entries that
do not fit are ignored and written anew.
"""

import hashlib
import json
import os
import shutil
import struct
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import platformdirs

from stsem.errors import OutputError
from stsem.frame import Frame, Segmentation
from stsem.inference.inferencer import Identity, Inferencer, Output, segmentation
from stsem.inference.network import Network
from stsem.uncertainty import CONFIDENCE_STEPS, MEASURES, Uncertainty

_MAGIC = b"stsem-o2"
_HEADER = struct.Struct("<8sHHBBIII")
# magic, width, height, bits of the measures, classes behind them, checksum of the input, of the payload, payload size
_LEVEL = 1


def cache_root() -> Path:
    """Folder of every cache of stsem: `STSEM_CACHE`, else the platform's user cache folder. It may not exist yet."""
    chosen = os.environ.get("STSEM_CACHE")
    return Path(chosen) if chosen else platformdirs.user_cache_path("stsem")


class OutputCache:
    """The outputs of one network, run in one way, on one log.

    Args:
        root: see `cache_root`.
        log_sha256: of the log's bytes.
        identity: network, backend, versions, precision and CPU features.

    Raises:
        OutputError: the folder cannot be made.
    """

    def __init__(self, root: Path, log_sha256: str, identity: Identity) -> None:
        about = json.dumps({"log_sha256": log_sha256, "confidence_steps": CONFIDENCE_STEPS, **asdict(identity)},
                           indent=1, sort_keys=True)  # fmt: skip
        self.folder = root / "outputs" / hashlib.sha256(about.encode()).hexdigest()[:32]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as err:
            raise _unwritable(self.folder, err) from err
        _write_atomically(self.folder / "about.json", about.encode())

    def get(self, stamp_ns: int, source: int) -> Output | None:
        """The entry of a stamp; None when there is none, when it is damaged, or when other pixels made it.

        Args:
            stamp_ns: capture stamp.
            source: `checksum` of the pixels.
        """
        try:
            return unpack((self.folder / f"{stamp_ns}.seg").read_bytes(), source)
        except OSError:
            return None

    def put(self, stamp_ns: int, source: int, output: Output) -> None:
        """Write or replace an entry. Raises OutputError when the folder cannot be written."""
        _write_atomically(self.folder / f"{stamp_ns}.seg", pack(output, source))


class CachedInferencer:
    """An `Inferencer` that reads back what it wrote, on a cold run too."""

    def __init__(self, inferencer: Inferencer, cache: OutputCache) -> None:
        self._inferencer, self._cache = inferencer, cache
        self.network, self.identity = inferencer.network, inferencer.identity

    def infer(self, frame: Frame) -> Segmentation:
        """See `Inferencer.infer`."""
        source = checksum(frame, self.network)
        output = self._cache.get(frame.stamp_ns, source)
        if output is None:
            computed = self._inferencer.compute(frame)
            self._cache.put(frame.stamp_ns, source, computed)
            output = self._cache.get(frame.stamp_ns, source) or computed
        return segmentation(output, frame.size)


def checksum(frame: Frame, network: Network) -> int:
    """CRC-32 of what the network sees of a frame: the pixels and shapes of its inputs, whatever else was loaded."""
    previous = frame.previous if network.has_difference else None
    depth = frame.depth if network.has_depth else None
    crc = 0
    for pixels in (frame.image, previous, depth):
        if pixels is None:
            crc = zlib.crc32(b"none", crc)
        else:
            crc = zlib.crc32(np.ascontiguousarray(pixels).data, zlib.crc32(repr(pixels.shape).encode(), crc))
    return crc


def pack(output: Output, source: int) -> bytes:
    """Bytes of an entry."""
    height, width = output.labels.shape
    said = output.uncertainty
    measures, classes, maps = (0, 0, b"") if said is None else (_bits(said), said.classes, said.levels.tobytes())
    payload = zlib.compress(output.labels.tobytes() + output.confidence.tobytes() + maps, _LEVEL)
    return _HEADER.pack(_MAGIC, width, height, measures, classes, source, zlib.crc32(payload), len(payload)) + payload


def unpack(entry: bytes, source: int) -> Output | None:
    """Output from the bytes of `pack`; None when they are damaged or made from other pixels."""
    if len(entry) < _HEADER.size:
        return None
    magic, width, height, bits, classes, made_from, crc, length = _HEADER.unpack_from(entry)
    payload = entry[_HEADER.size :]
    if (magic, made_from, length) != (_MAGIC, source, len(payload)) or zlib.crc32(payload) != crc:
        return None
    planes = np.frombuffer(zlib.decompress(payload), np.uint8)
    measures = tuple(measure for i, measure in enumerate(MEASURES) if bits >> i & 1)
    if planes.size != (2 + len(measures)) * width * height:
        return None
    labels, confidence, *maps = planes.reshape(-1, height, width)
    return Output(labels, confidence, Uncertainty(measures, np.stack(maps), classes) if maps else None)


def _bits(uncertainty: Uncertainty) -> int:
    return sum(1 << i for i, measure in enumerate(MEASURES) if measure in uncertainty.measures)


@dataclass(frozen=True)
class CacheUsage:
    """What the cache holds: files of any kind (network outputs, cost profiles), and their bytes."""

    root: Path
    files: int
    bytes: int


def usage(root: Path) -> CacheUsage:
    """Count the files below `root`; a folder that does not exist holds nothing."""
    sizes = [path.stat().st_size for path in root.rglob("*") if path.is_file()]
    return CacheUsage(root, len(sizes), sum(sizes))


def clear(root: Path) -> CacheUsage:
    """Remove the network outputs and cost profiles below `root`, nothing else; returns what was removed.

    Raises:
        OutputError: something there cannot be removed.
    """
    folders = [folder for folder in (root / "outputs", root / "costs") if folder.is_dir()]
    found = [usage(folder) for folder in folders]
    for folder in folders:
        try:
            shutil.rmtree(folder)
        except OSError as err:
            raise _unwritable(folder, err) from err
    return CacheUsage(root, sum(one.files for one in found), sum(one.bytes for one in found))


def _write_atomically(path: Path, data: bytes) -> None:
    """Beside, then renamed: a reader, or a run that was killed, never sees half a file."""
    aside = path.with_suffix(f".{os.getpid()}.part")
    try:
        aside.write_bytes(data)
        aside.replace(path)
    except OSError as err:
        aside.unlink(missing_ok=True)
        raise _unwritable(path.parent, err) from err


def _unwritable(folder: Path, err: OSError) -> OutputError:
    return OutputError(
        f"The cache folder {folder} cannot be written ({err.strerror}); set STSEM_CACHE to another, or use --no-cache."
    )
