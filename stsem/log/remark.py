"""What is said about a log while it is opened."""

from typing import Self


class Remark(str):
    """A sentence, and the name of what it is about.

    Everywhere it is a sentence; the doctor finds by the name what to do about it (`stsem/log/doctor/checks.py`).

    Args:
        name: in the doctor's table.
        sentence: with its numbers.
    """

    __slots__ = ("name",)
    name: str

    def __new__(cls, name: str, sentence: str) -> Self:
        """The sentence, named."""
        remark = super().__new__(cls, sentence)
        remark.name = name
        return remark

    def __reduce__(self) -> tuple[type[Self], tuple[str, str]]:
        """What makes a copy: reports are plain data made by copying."""
        return type(self), (self.name, str(self))
