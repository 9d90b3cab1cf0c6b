"""What a training reads: logs, folders of images, and folders of pairs; told apart by what is in them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stsem.classes import ClassSet
from stsem.errors import ClassTableError, TrainingError, UsageError
from stsem.log.classtable import ClassTable, parse, read_file
from stsem.log.container.source import is_url, shown_name
from stsem.log.describe import log_name
from stsem.log.log import open_log
from stsem.train.dataset import PairFolder, Pairs, fingerprint
from stsem.train.image_pairs import ImagePairs, is_image_folder
from stsem.train.log_pairs import decode_log
from stsem.train.vocabulary import ClassMap, Joined, Translated, lookup, network_classes

TABLES = ("classes.json", "classes.toml", "classes.txt")


@dataclass(frozen=True, eq=False)
class Source:
    """One data set, opened.

    Args:
        name: for people.
        pairs: with labels in ids of their own.
        classes: of these ids.
        size: (width, height) of its first image.
        notes: what to know about it.
    """

    name: str
    pairs: Pairs
    classes: ClassSet
    size: tuple[int, int]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reading:
    """How data is read.

    Args:
        cache: folder for the frames of logs, one folder below it for each.
        classes_file: class table instead of the data's own.
        depth: keep depth, too.
        topics: role -> topic, as for a replay.
        progress: called with (frames done, frames in all).
    """

    cache: Path
    classes_file: Path | None = None
    depth: bool = False
    topics: Mapping[str, str] | None = None
    progress: Callable[[int, int], None] = lambda done, total: None


def open_source(parts: Sequence[str], how: Reading) -> Source:
    """Open a data set: one folder, or the parts of one recording.

    Raises:
        StsemError: it cannot be read, has no labels, or no class table.
    """
    folder = Path(parts[0])
    if is_url(parts[0]) or not folder.is_dir():
        return _log(parts, how)
    unused = f"--topic says nothing of the folder {folder}." if how.topics else ""
    if is_image_folder(folder):
        images = ImagePairs(folder, _table(folder, how.classes_file), depth=how.depth)
        lost = f"Label images of {folder} that belong to no image: {images.orphans}." if images.orphans else ""
        return _source(str(folder), images, images.classes, lost, unused)
    if any(folder.glob("*.npz")):
        return _source(str(folder), PairFolder(folder), _plain(_table(folder, how.classes_file)), unused)
    if any(folder.rglob("*.mcap")):
        return _log(parts, how)
    raise TrainingError(f"The folder {folder} holds no log (*.mcap), no pairs (*.npz), and no folders images and "
                        "labels; docs/train.md says how to lay it out.")  # fmt: skip


def join(sources: Sequence[Source], classes: ClassSet, class_map: ClassMap) -> Pairs:
    """All pairs of the sources, with labels in the ids of `classes`.

    Raises:
        ClassTableError: a source has other classes.
    """
    tables = (lookup(one.classes, classes, _known(one, class_map), one.name) for one in sources)
    return Joined([
        Translated(one.pairs, table, known=len(one.classes), name=one.name)
        for one, table in zip(sources, tables, strict=True)
    ])  # fmt: skip


def classes_of(sources: Sequence[Source], class_map: ClassMap) -> ClassSet:
    """The classes of a network that learns from the sources: those of the first, renamed.

    Raises:
        ClassTableError: the map names a class that no source has.
    """
    for name in class_map:
        if all(one.classes.find(name) is None for one in sources):
            names = ", ".join(sources[0].classes.names)
            raise ClassTableError(f"The class map names {name!r}, which no data has; the first has {names}.")
    return network_classes(sources[0].classes, _known(sources[0], class_map))


def _known(source: Source, class_map: ClassMap) -> ClassMap:
    return {name: to for name, to in class_map.items() if source.classes.find(name) is not None}


def _source(name: str, pairs: Pairs, classes: ClassSet, *notes: str) -> Source:
    height, width = pairs.pair(0).images.shape[1:3]
    return Source(name, pairs, classes, (width, height), tuple(note for note in notes if note))


def _log(parts: Sequence[str], how: Reading) -> Source:
    with open_log(parts, topics=how.topics, classes_file=how.classes_file) as log:
        folder = how.cache / f"{log_name(parts)}-{fingerprint([log.info.sha256, str(how.depth)])[:8]}"
        if how.depth and log.info.choice.depth is None:
            raise TrainingError(f"The log {log.info.name} has no depth, which the network takes; choose another one.")
        pairs = decode_log(log, folder, depth=how.depth, report=how.progress)
        notes = (
            [f"{pairs.unreadable} labelled frames of {log.info.name} cannot be decoded."] if pairs.unreadable else []
        )
        return _source(", ".join(map(shown_name, parts)), pairs, pairs.classes, *notes, *log.info.warnings)


def _table(folder: Path, stated: Path | None) -> ClassTable:
    path = stated or next((folder / name for name in TABLES if (folder / name).is_file()), None)
    if path is None:
        raise ClassTableError(f"The labels of {folder} have no class table; give --classes FILE, or put one of "
                              f"{', '.join(TABLES)} into it.")  # fmt: skip
    if path.suffix.lower() != ".txt":
        return read_file(path)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as err:
        raise ClassTableError(f"The class table {path} cannot be read as text ({err}); mend it.") from err
    return parse([line.strip() for line in lines if line.strip()], str(path))


def _plain(table: ClassTable) -> ClassSet:
    """Of pairs, whose labels are ids from 0."""
    if table.raw_ids != tuple(range(len(table.classes))):
        raise UsageError(f"The class table {table.source} has the ids {list(table.raw_ids)}, but pairs in .npz files "
                         "have ids from 0 on; give one that counts from 0.")  # fmt: skip
    return table.classes
