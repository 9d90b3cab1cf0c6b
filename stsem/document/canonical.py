"""The bytes of a report: one document, one sequence of bytes, one digest."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any

from pydantic import JsonValue, ValidationError

from stsem.document.part import plain
from stsem.document.schema import SCHEMA_VERSION, Document
from stsem.errors import UsageError

OUTSIDE_DIGEST = ("host", "digest")
"""Top-level keys that the digest leaves out."""
_ADDED = ("calibration", "error_detection")
"""Parts of a run that came after baselines were first kept: where they are empty, older results are the same."""
_RESULTS = ("schema_version", "state", "accuracy_state", "input", "runs", "comparison", "more_comparisons")


def canonical(value: Any) -> bytes:
    """Canonical JSON: sorted keys, indent of two, shortest floats that read back equal, NaN as null, UTF-8, newline.

    Raises:
        ValueError: a number is infinite.
    """
    text = json.dumps(_clean(plain(value)), sort_keys=True, indent=2, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def _clean(value: Any) -> Any:
    if isinstance(value, float):
        return None if math.isnan(value) else value + 0.0  # -0.0 and 0.0 are one number
    if isinstance(value, dict):
        return {key: _clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(item) for item in value]
    return value


def as_json(document: Document) -> dict[str, JsonValue]:
    """The document as plain JSON values."""
    values: dict[str, JsonValue] = document.model_dump(mode="json")
    return values


def digest(document: Document) -> str:
    """sha256 (hex) of the canonical JSON without `host` and `digest`."""
    kept = {key: value for key, value in as_json(document).items() if key not in OUTSIDE_DIGEST}
    return hashlib.sha256(canonical(kept)).hexdigest()


def results_digest(document: Document) -> str:
    """sha256 (hex) of what was measured alone: input, runs, comparisons, states; no versions, no configuration.

    A gate asks for equal results across installations, where `digest` differs by the version of any package.
    """
    kept = {key: value for key, value in as_json(document).items() if key in _RESULTS}
    runs = [run.model_dump(mode="json") for run in document.runs]
    kept["runs"] = [{key: value for key, value in run.items() if value or key not in _ADDED} for run in runs]
    return hashlib.sha256(canonical(kept)).hexdigest()


def config_hash(config: dict[str, JsonValue]) -> str:
    """sha256 (hex) of the canonical JSON of a resolved configuration."""
    return hashlib.sha256(canonical(config)).hexdigest()


def sealed(document: Document) -> Document:
    """The document with `config_hash` and `digest` filled in."""
    hashed = document.model_copy(update={"config_hash": config_hash(document.config)})
    return hashed.model_copy(update={"digest": digest(hashed)})


def to_bytes(document: Document) -> bytes:
    """report.json."""
    return canonical(as_json(document))


def read_document(path: Path) -> Document:
    """Read report.json, or the report.json inside a report folder.

    Raises:
        UsageError: there is no such file, it is no report, or it is one of another schema version.
    """
    file = path / "report.json" if path.is_dir() else path
    try:
        values = json.loads(file.read_bytes())
    except OSError as err:
        raise UsageError(
            f"The report {file} cannot be read ({err.strerror}); give a report.json or its folder."
        ) from err
    except ValueError as err:
        raise UsageError(f"{file} is not a report: it is no JSON; give a report.json written by stsem.") from err
    return document_from(values, str(file))


def document_from(values: object, source: str) -> Document:
    """A checked document from plain JSON values; `source` names them in errors.

    Raises:
        UsageError: not a report, another schema version, or a report with a wrong field (the first is named).
    """
    if not isinstance(values, dict) or "schema_version" not in values:
        raise UsageError(f"{source} is not a report: it has no schema_version; give a report.json written by stsem.")
    if (version := values["schema_version"]) != SCHEMA_VERSION:
        raise UsageError(
            f"{source} has schema version {version!r}, this stsem reads {SCHEMA_VERSION}; make the report again."
        )
    try:
        return Document.model_validate(values)
    except ValidationError as err:
        first = err.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the whole"
        raise UsageError(f"{source} is not a report of this schema: {where}: {first['msg']}; make it again.") from err
