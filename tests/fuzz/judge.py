"""What is a failure: the rules, each with a reason in one line."""

import json
import re
from collections.abc import Mapping

from stsem.plain import MAX_SENTENCE
from tests.fuzz.evaluate import Content, Outcome
from tests.fuzz.subjects import SUBJECTS

MAX_SECONDS = 10.0
MAX_BYTES = 2 << 30
EXCEPTION = re.compile(r"\b[A-Z][A-Za-z]*(?:Error|Exception|Warning)\b|Traceback|defect of stsem| object at 0x")


def failure(name: str, outcome: Outcome, references: Mapping[str, Content]) -> str:
    """Why the `outcome` of a mutant of the log `name` is wrong; "" when it is right.

    Args:
        name: of the log that was mutated.
        outcome: of the mutant.
        references: name -> content of each undamaged log.
    """
    found = _conduct(outcome)
    if not found and outcome.kind == "valid" and SUBJECTS[name].protected:
        found = _silent(outcome.content, references, name)
    return found


def _conduct(outcome: Outcome) -> str:
    """What holds for every log, whatever it is."""
    if outcome.kind == "crashed":
        return f"traceback: {outcome.error} at {outcome.text}"
    if outcome.kind == "refused" and (trouble := sentence_trouble(outcome.text)):
        return f"{trouble}: {outcome.text!r}"
    if outcome.seconds > MAX_SECONDS:
        return f"took {outcome.seconds:.1f} s"
    if outcome.peak_bytes > MAX_BYTES:
        return f"held {outcome.peak_bytes / 2**30:.2f} GiB"
    if outcome.left_open > 0:
        return f"left {outcome.left_open} files open"
    if outcome.files:
        return f"wrote {', '.join(outcome.files)}"
    return ""


def sentence_trouble(text: str) -> str:
    """Why `text` is not one sentence for people; "" when it is."""
    if not text.isprintable():
        return "the sentence has characters that do not print"
    if not text.endswith("."):
        return "the sentence has no full stop"
    if len(text) > MAX_SENTENCE:
        return "the sentence is too long"
    return "the sentence names an exception" if EXCEPTION.search(text) else ""


def _silent(content: Content, references: Mapping[str, Content], name: str) -> str:
    """A log that counts as undamaged must have the undamaged log's content.

    A mutant may be the whole of another log: then that one's.
    """
    if any(content == reference for reference in references.values()):
        return ""
    reference = references[name]
    keys = [key for key in sorted(content.keys() | reference.keys()) if content.get(key) != reference.get(key)]
    first = keys[0]
    shown = json.dumps(content.get(first), default=str), json.dumps(reference.get(first), default=str)
    at = next((i for i, (a, b) in enumerate(zip(*shown, strict=False)) if a != b), min(map(len, shown)))
    around = [text[max(0, at - 60) : at + 40] for text in shown]
    return f"valid, but other than undamaged in {', '.join(keys)}: {around[0]!r} instead of {around[1]!r}"
