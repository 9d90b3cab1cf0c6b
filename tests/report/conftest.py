"""The made-up run, and one report folder written from it, for every test of this folder."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from stsem.report.folder import folder_name, write_folder

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole report folder, pictures and map included."""
    from made_up_run import example

    cloud = tmp_path_factory.mktemp("map") / "map.ply"
    cloud.write_bytes(b"ply\n")
    inputs = replace(example(), point_cloud=cloud)
    return write_folder(inputs, tmp_path_factory.mktemp("reports") / "office" / folder_name(inputs.document))
