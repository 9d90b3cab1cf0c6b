"""ROS bags to MCAP: messages are copied as they are, with the definitions of their types and their log times."""

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from stsem.aside import aside
from stsem.convert import rosbag1, rosbag2
from stsem.convert.definitions import definition
from stsem.convert.recording import Loss, Options, Progress, Summary
from stsem.errors import ConversionError
from stsem.log.container.records import MAGIC
from stsem.log.mcapfile import McapFile
from stsem.log.tracks import MAX_NS

MAX_CHANNELS = 10_000
_NO_EFFECT = "Bags are copied as they are: give --classes and the like to stsem-replay, not here."
_OUT_OF_TIME = "messages with a log time that cannot be"


def is_rosbag1(source: Path) -> bool:
    """Whether it is a ROS 1 bag: by its first bytes."""
    return _begins_with(source, b"#ROSBAG V")


def is_rosbag2(source: Path) -> bool:
    """Whether it is a sqlite3 file of a ROS 2 bag, or a folder with one."""
    return bool(rosbag2.bag_files(source))


def is_mcap(source: Path) -> bool:
    """Whether it is an MCAP file, or a folder with one: nothing to be converted."""
    with suppress(OSError):
        return _begins_with(source, MAGIC) or (
            source.is_dir() and any(path.suffix == ".mcap" and path.is_file() for path in source.iterdir())
        )
    return False


def convert_rosbag1(source: Path, out: Path, options: Options, progress: Progress) -> Summary:
    """A ROS 1 bag.

    Raises:
        ConversionError: it is none, or holds no message; OutputError: the file cannot be written.
    """
    with McapFile(out, profile="ros1") as log:
        copy = _Copy(log, source, options)
        size = source.stat().st_size
        for done, found in rosbag1.messages(source):
            if isinstance(found, Loss):
                copy.lose(found)
            else:
                copy.from_rosbag1(found)
            progress(done, size)
        return copy.summary()


def convert_rosbag2(source: Path, out: Path, options: Options, progress: Progress) -> Summary:
    """A ROS 2 bag in sqlite3: all files of a folder, as one log.

    Raises:
        ConversionError: it is none, or holds no message; MissingExtraError: the bag does not hold the definitions of
            its types and the extra `convert` is not installed; OutputError: the file cannot be written.
    """
    scratch = aside(out, rosbag2.SUFFIX)
    with McapFile(out, profile="ros2") as log:
        copy = _Copy(log, source, options)
        files_missing, expected = rosbag2.stated(source)
        for found in _all_files(source, scratch, progress):
            if isinstance(found, Loss):
                copy.lose(found)
                expected -= found.count if found.what == rosbag2.MISSING else 0
            else:
                copy.from_rosbag2(found)
                expected -= 1
        copy.lose(Loss("files that metadata.yaml names and that are not there", count=files_missing))
        copy.lose(Loss("messages that metadata.yaml counts and that cannot be read", count=max(expected, 0)))
        return copy.summary()


def _all_files(source: Path, scratch: Path, progress: Progress) -> Iterator[rosbag2.Message | Loss]:
    """Messages of all files; a file that cannot be read among others is a loss."""
    files = rosbag2.bag_files(source)
    total = sum(path.stat().st_size for path in files)
    end = 0
    for path in files:
        done, end = end, end + path.stat().st_size
        try:
            for found in rosbag2.messages(path, scratch):
                done += len(found.data) if isinstance(found, rosbag2.Message) else 0
                progress(min(done, end), total)
                yield found
        except ConversionError:
            if len(files) == 1:
                raise
            yield Loss("files of the bag that cannot be read")


class _Copy:
    """Channels as they come to be needed, messages, and what is lost."""

    def __init__(self, log: McapFile, source: Path, options: Options) -> None:
        self._log, self._source = log, source
        self._notes = (_NO_EFFECT,) if options != Options() else ()
        self._known: dict[rosbag1.Connection | rosbag2.Topic, int | str] = {}
        self._channels: dict[tuple[str, int], int] = {}
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._losses: Counter[str] = Counter()
        self._sequences: Counter[int] = Counter()

    def lose(self, loss: Loss) -> None:
        if loss.count:
            self._losses[loss.what] += loss.count

    def from_rosbag1(self, message: rosbag1.Message) -> None:
        connection = message.connection
        if connection not in self._known:
            schema = connection.type_name, "ros1msg", connection.definition
            self._known[connection] = self._channel(connection.topic, schema, "ros1")
        self._write(self._known[connection], message.log_ns, message.data)

    def from_rosbag2(self, message: rosbag2.Message) -> None:
        if message.topic not in self._known:
            self._known[message.topic] = self._rosbag2_channel(message.topic)
        self._write(self._known[message.topic], message.log_ns, message.data)

    def summary(self) -> Summary:
        """What was written.

        Raises:
            ConversionError: nothing was.
        """
        losses = dict(self._losses)
        if not any(self._log.counts.values()):
            lost = "; ".join(f"{count} {what}" for what, count in losses.items()) or "it is empty"
            raise ConversionError(f"No message of {self._source} could be copied ({lost}): no log was written.")
        return Summary(dict(self._log.counts), losses, self._notes)

    def _rosbag2_channel(self, topic: rosbag2.Topic) -> int | str:
        """The channel of a topic, or why it has none."""
        if topic.serialization != "cdr":
            return f"messages of {topic.name}, which are encoded as {topic.serialization!r} and not as cdr"
        encoding, text = topic.schema_encoding, topic.definition
        if not text:
            encoding, text = "ros2msg", definition(topic.type_name) or ""
        if not text:
            return f"messages of {topic.name}, as nobody knows the definition of {topic.type_name}"
        return self._channel(topic.name, (topic.type_name, encoding, text), "cdr")

    def _channel(self, topic: str, schema: tuple[str, str, str], encoding: str) -> int | str:
        """One channel for all publishers of one type on one topic."""
        if schema not in self._schemas:
            name, language, text = schema
            self._schemas[schema] = self._log.schema(name, language, text.encode())
        key = topic, self._schemas[schema]
        if key not in self._channels:
            if len(self._channels) == MAX_CHANNELS:
                return f"messages of more than {MAX_CHANNELS} topics"
            self._channels[key] = self._log.channel(topic, self._schemas[schema], encoding)
        return self._channels[key]

    def _write(self, channel: int | str, log_ns: int, data: bytes) -> None:
        if isinstance(channel, str):
            self._losses[channel] += 1
        elif not 0 <= log_ns < MAX_NS:
            self._losses[_OUT_OF_TIME] += 1
        else:
            self._log.message(channel, log_ns, log_ns, data, self._sequences[channel])
            self._sequences[channel] += 1


def _begins_with(source: Path, magic: bytes) -> bool:
    try:
        if not source.is_file():
            return False
        with source.open("rb") as stream:
            return stream.read(len(magic)) == magic
    except OSError:
        return False
