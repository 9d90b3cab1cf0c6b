"""Logs at an address: like files, in few requests, and one sentence for whatever goes wrong."""

import hashlib
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType

pytest.importorskip("aiohttp", reason="needs the extra 'remote'")

import fsspec
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, room
from range_server import Behaviour, serving

from stsem.errors import LogError, MissingExtraError, StsemError
from stsem.log.container import remote
from stsem.log.container.files import find_files
from stsem.log.container.source import is_url, shown_name, without_secrets
from stsem.log.container.store import Store
from stsem.log.log import open_log
from stsem.log.scan import scan

IMAGE = "sensor_msgs/msg/Image"
BLOCK = 1 << 17


@pytest.fixture(scope="module")
def bulky(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log of 4 MB in chunks of 60 kB: colour, labels logged 3 frames late, and bulk that nobody reads."""
    path = tmp_path_factory.mktemp("bulky") / "bulky.mcap"
    log = Recorder(path, compression=CompressionType.NONE, chunk_size=40_000)
    noise = np.random.Generator(np.random.PCG64(0))
    for i in range(60):
        stamp = BASE_NS + i * PERIOD_NS
        log.ros("/cam/color", IMAGE, ROS.image(stamp, noise.integers(0, 255, (48, 64, 3), np.uint8), "rgb8"), stamp)
        log.add("/lidar", "Cloud", "", b"", "bulk", noise.bytes(50_000), stamp)
        if i >= 3:
            late = BASE_NS + (i - 3) * PERIOD_NS
            log.ros("/gt/labels", IMAGE, ROS.image(late, label_picture(i, width=64, height=48), "mono8"), stamp)
    return log.close().read_bytes()


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Blocks of 128 kB and a cache in proportion: 4 MB behave as a quarter of a gigabyte does with blocks of 8 MiB."""
    monkeypatch.setattr(remote, "BLOCK_BYTES", BLOCK)
    monkeypatch.setattr("stsem.log.log.Store", partial(Store, cache_bytes=12 * BLOCK))
    monkeypatch.setattr("stsem.log.scanned.CACHE_BYTES", 0)
    return


def answers(paths: list[Any]) -> list[Any]:
    """What a whole pass with two threads sees of a log."""
    with open_log(paths) as log:
        frames = log.frames(range(len(log.plans)), depth=True, previous=True, truth=True)
        seen = [
            (f.frame.image.tobytes() if f.frame else None, None if f.truth is None else f.truth.tobytes())
            for f in frames
        ]
        return [log.info.sha256, log.info.size_bytes, log.plans[:], seen]


@pytest.mark.usefixtures("small_blocks")
def test_a_whole_replay_needs_few_requests(bulky: bytes, tmp_path: Path) -> None:
    """Two passes over S bytes, mixed channels, two threads: at most 2 S / block + 10 requests, and 10 for looks."""
    (tmp_path / "bulky.mcap").write_bytes(bulky)
    does = Behaviour({"/logs/bulky.mcap": bulky})
    with serving(does) as host:
        far = answers([f"{host}/logs/bulky.mcap"])
    assert far == answers([tmp_path / "bulky.mcap"])
    assert far[0] == hashlib.sha256(bulky).hexdigest()
    assert len(bulky) // BLOCK > 25
    assert 2 * len(bulky) // BLOCK < len(does.requests) <= 2 * len(bulky) // BLOCK + 20


@pytest.mark.usefixtures("small_blocks")
def test_few_blocks_are_held(bulky: bytes) -> None:
    with serving(Behaviour({"/b.mcap": bulky})) as host:
        (file,) = find_files([f"{host}/b.mcap"])
        with file.source.open() as stream:
            assert isinstance(stream, remote.BlockStream)
            while stream.read(10_000):
                assert len(stream._blocks) <= remote.BLOCKS_KEPT


def test_a_short_log_is_read_once(room_log: Path) -> None:
    does = Behaviour({"/room.mcap": room_log.read_bytes()})
    with serving(does) as host, open_log([f"{host}/room.mcap"]) as log:
        assert log.info.name == "room"
        assert [loaded.error for loaded in log.frames(range(6), depth=True, previous=True, truth=True)] == [None] * 6
    assert does.gets == 1


def test_secrets_are_sent_but_not_shown(room_log: Path) -> None:
    """User, password and token reach the server, and neither the name nor what is shown."""
    does = Behaviour({"/a/room 1.mcap": b"", "/a/room%201.mcap": room_log.read_bytes()})
    with serving(does) as host:
        address = f"{host.replace('//', '//someone:secret@')}/a/room%201.mcap?token=hidden#part"
        with open_log([address]) as log:
            assert log.info.name == "room 1"
            assert [str(source) for source in log.info.sources] == [f"{host}/a/room%201.mcap"]
            assert "hidden" not in repr(log.info)
            assert "secret" not in repr(log.info)
    assert all(header and header.startswith("Basic ") for header in does.authorization)


def sentence(address: str, secret: str = "hidden") -> str:
    """What reading `address` says; one sentence, without what is secret in it."""
    with pytest.raises(StsemError) as caught:
        scan(find_files([f"{address}?token={secret}"]))
    text = str(caught.value)
    assert secret not in text
    assert text.endswith(".")
    assert "\n" not in text
    return text


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"files": {}}, "There is no file http://"),
        ({"status": {"/x.mcap": 403}}, "refuses access"),
        ({"status": {"/x.mcap": 401}}, "refuses access"),
        ({"status": {"/x.mcap": 500}}, "status 500"),
        ({"ranges": False}, "does not send parts of files"),
        ({"dies_after": 20}, "cannot be read"),
        ({"claims": {"/x.mcap": 5_000_000}}, "its server said 5000000"),
        ({"moved": {"/x.mcap": "/y.mcap"}}, "There is no file http://"),
        ({"moved": {"/x.mcap": "/x.mcap"}}, "cannot be read (TooManyRedirects)"),
        ({"files": {"/x.mcap": b"<html>Please log in</html>"}}, "is not an MCAP file"),
        ({"files": {"/x.mcap": b""}}, "is empty"),
    ],
    ids=["404", "403", "401", "500", "no ranges", "dies", "lies", "moved away", "circle", "html", "empty"],
)  # fmt: skip
def test_servers_that_misbehave(bulky: bytes, options: dict[str, Any], words: str) -> None:
    with serving(Behaviour(**({"files": {"/x.mcap": bulky}} | options))) as host:
        assert words in sentence(f"{host}/x.mcap")


def test_a_server_that_understates_the_size(bulky: bytes) -> None:
    """What it announces is read, and the log counts as truncated."""
    with serving(Behaviour({"/x.mcap": bulky}, claims={"/x.mcap": 1_000_000})) as host:
        result = scan(find_files([f"{host}/x.mcap"]))
    assert result.damage.lossy
    assert "truncated" in result.damage.counts


def test_nobody_there() -> None:
    with serving(Behaviour({})) as host:
        pass
    assert "cannot be read" in sentence(f"{host}/x.mcap")


def test_a_query_may_choose_the_file(room_log: Path) -> None:
    with serving(Behaviour({"/get": room_log.read_bytes()})) as host:
        assert len(find_files([f"{host}/get?part=0", f"{host}/get?part=1"])) == 2


def test_redirects_are_followed(room_log: Path) -> None:
    does = Behaviour({"/there.mcap": room_log.read_bytes()}, moved={"/here.mcap": "/there.mcap"})
    with serving(does) as host, open_log([f"{host}/here.mcap"]) as log:
        assert log.info.name == "here"


def test_a_remote_file_that_changes_is_noticed(bulky: bytes) -> None:
    """Of the same size, but another ETag: between the two passes."""
    does = Behaviour({"/x.mcap": bulky})
    with serving(does) as host:
        (file,) = find_files([f"{host}/x.mcap"])
        file.source.open().close()
        does.files["/x.mcap"] = bulky[:-1] + b"!"
        with pytest.raises(LogError, match="changed while it was being read"):
            file.source.open()


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[Any]:
    """An object store: s3://bucket/run/ by another name."""
    system = fsspec.filesystem("memory")
    for name in ("run_10", "run_9"):
        system.pipe(f"/bucket/run/{name}.mcap", room(tmp_path / f"{name}.mcap").read_bytes())
    system.pipe("/bucket/run/metadata.yaml", b"")
    system.pipe("/bucket/none/readme.txt", b"")
    yield system
    system.rm("/bucket", recursive=True)


@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("address", ["memory://bucket/run/", "memory://bucket/run", "memory://bucket/run/run_*.mcap"])
def test_folders_and_patterns(address: str) -> None:
    """In natural order, as one log."""
    assert [file.source.name for file in find_files([address])] == ["run_9.mcap", "run_10.mcap"]


@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("address", ["memory://bucket/none/", "memory://bucket/run/*.bag"])
def test_folders_without_a_recording(address: str) -> None:
    with pytest.raises(LogError, match=r"holds no \.mcap file"):
        find_files([address])


def test_a_folder_of_a_web_server(room_log: Path) -> None:
    """Its index page is the list, if it has one."""
    index = b'<a href="room_1.mcap">one</a> <a href="room_0.mcap">zero</a> <a href="x.txt">x</a>'
    files = {"/run/": index, "/bare/": b"hello", "/run/room_0.mcap": b"0", "/run/room_1.mcap": b"1"}
    with serving(Behaviour(files)) as host:
        assert [file.source.name for file in find_files([f"{host}/run/"])] == ["room_0.mcap", "room_1.mcap"]
        assert "holds no .mcap file" in sentence(f"{host}/bare/")


@pytest.mark.parametrize(
    ("missing", "address", "extra"),
    [("fsspec", "https://h/x.mcap", "remote"), ("aiohttp", "https://h/x.mcap", "remote"), ("fsspec", "s3://b/x", "s3")],
)
def test_without_the_extra(monkeypatch: pytest.MonkeyPatch, missing: str, address: str, extra: str) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'stsem\[{extra}\]'"):
        find_files([address])


def test_an_unknown_protocol() -> None:
    with pytest.raises(LogError, match="gopher:// is unknown"):
        find_files(["gopher://h/x.mcap"])


def test_local_paths_never_touch_the_network(room_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Promise P6: not even fsspec is imported."""
    monkeypatch.setitem(sys.modules, "fsspec", None)
    monkeypatch.setitem(sys.modules, "stsem.log.container.remote", None)
    for given in (room_log, str(room_log), room_log.as_uri()):
        with open_log([given]) as log:
            assert log.info.name == "room"


@pytest.mark.parametrize(
    ("address", "shown", "name"),
    [
        ("https://user:pw@host:8080/a/b.mcap?X-Amz-Signature=1#x", "https://host:8080/a/b.mcap", "b.mcap"),
        ("https://u:p@ss@host/b%20c.mcap", "https://host/b%20c.mcap", "b c.mcap"),
        ("/tmp/a?b@c:d.mcap", "/tmp/a?b@c:d.mcap", "a?b@c:d.mcap"),
        ("zip://in/a.mcap::https://u:p@host/b.zip?t=1", "zip://in/a.mcap::https://host/b.zip", "a.mcap"),
        ("simplecache::https://u:p@host/b.mcap?t=1", "simplecache::https://host/b.mcap", "b.mcap"),
        ("http://u:p@[fe80::a:1]:80/b.mcap?t=1", "http://[fe80::a:1]:80/b.mcap", "b.mcap"),
        ("https://user:p?w@host/b.mcap", "https://user", "user"),
    ],
)
def test_what_is_shown_of_an_address(address: str, shown: str, name: str) -> None:
    """Of one that cannot be, rather nothing than a part of the password."""
    assert (without_secrets(address), shown_name(address)) == (shown, name)


def test_what_is_an_address() -> None:
    addresses = ("https://h/x.mcap", "s3://b/x.mcap", "zip://x.mcap::gs://b/y.zip", "memory://x")
    assert all(map(is_url, addresses))
    assert not any(map(is_url, ("x.mcap", "C:\\x.mcap", "a::b.mcap", "file:///x.mcap", Path("https://h/x.mcap"))))
