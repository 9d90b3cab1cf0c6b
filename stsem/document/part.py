"""What every part of a report shares: plain numbers in, NaN as null, no unknown keys."""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator


def plain(value: Any) -> Any:
    """`value` with numpy scalars and arrays turned into Python ones, tuples into lists, at any depth."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _nan_to_none(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


Number = Annotated[Annotated[float, Field(allow_inf_nan=False)] | None, BeforeValidator(_nan_to_none)]
"""A finite number, or null when it was not measured. NaN comes in as null; infinity is an error."""

Share = Annotated[Annotated[float, Field(ge=0.0, le=1.0)] | None, BeforeValidator(_nan_to_none)]
"""A fraction in 0..1, or null when it was not measured."""

Count = Annotated[int, Field(ge=0)]
"""How many of something."""


class Part(BaseModel):
    """A part of the report: immutable, strict about its keys, described field by field for the published schema."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True, allow_inf_nan=False, validate_default=False
    )

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, data: Any) -> Any:
        return plain(data)


def definition(part: type[Part], field: str) -> str:
    """What a field means, in the words of the schema: views explain a number with the sentence that defines it."""
    return part.model_fields[field].description or ""
