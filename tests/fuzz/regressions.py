"""Mutants that were once a failure: (log, seed), what becomes of them now, and what was wrong.

`mutate.py` and `subjects.py` give them the same bytes as long as their operators, weights and logs are not changed.
"""

REGRESSIONS: dict[tuple[str, int], tuple[str, str]] = {
    ("ours", 1841): ("lossy", "a wrong bit in an attachment with a checksum made the whole log unreadable"),
    ("ours", 1577): ("lossy", "the same, with bytes that were put in"),
}
