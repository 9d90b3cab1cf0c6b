"""What a coverage-guided fuzzer would feed can be fed, and a few mutants of it do no harm."""

import sys
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tests.fuzz import atheris_log
from tests.fuzz.entries import ENTRIES
from tests.fuzz.mutate import mutant

MUTANTS = {"log": 4}
OTHERWISE = 150


@pytest.mark.parametrize("name", ENTRIES)
def test_seeds_are_read_and_mutants_do_no_harm(name: str) -> None:
    entry, seeds = ENTRIES[name], ENTRIES[name].seeds()
    assert seeds
    for seed in seeds:
        entry.feed(seed)
    named = {f"{name} {k}": seed for k, seed in enumerate(seeds)} | {"other": b"".join(seeds)[:5000]}
    for number in range(MUTANTS.get(name, OTHERWISE)):
        entry(mutant(named, f"{name} {number % len(seeds)}", number).data)
    for odd in (b"", b"\0", b"\xff" * 40, bytes(200)):
        entry(odd)


def test_two_fields_of_one_name_are_no_message_type() -> None:
    """One repeated and one not: a list was expected where a text stood. Found by coverage."""
    entry = ENTRIES["descriptors"]
    (data,) = (seed for seed in entry.seeds() if b"CompressedImage" in seed and b"RawImage" not in seed)
    files = FileDescriptorSet.FromString(data[1:])
    (image,) = (one for file in files.file for one in file.message_type if one.name == "CompressedImage")
    twin = image.field.add()
    twin.CopyFrom(next(field for field in image.field if field.name == "format"))
    twin.number, twin.label = 90, twin.LABEL_REPEATED
    with pytest.raises(ValueError, match="two fields of one name"):
        entry.feed(data[:1] + files.SerializeToString())


def test_without_atheris_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "atheris", None)
    assert atheris_log.main(["rvl", str(tmp_path / "corpus")]) == 1
    assert "pip install atheris" in capsys.readouterr().err
    assert atheris_log.main(["nothing"]) == 2
    assert "entries: log, rvl" in capsys.readouterr().err


def test_the_first_files_of_a_corpus(tmp_path: Path) -> None:
    atheris_log.write_seeds(ENTRIES["rvl"], tmp_path / "corpus")
    assert [path.read_bytes() for path in (tmp_path / "corpus").iterdir()] == ENTRIES["rvl"].seeds()
    assert sum(len(seed) for entry in ENTRIES.values() for seed in entry.seeds()) < 400_000
