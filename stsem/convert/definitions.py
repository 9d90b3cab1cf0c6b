"""Definitions of ROS 2 message types for bags that were recorded before they stood in the bag (before ROS 2 Iron)."""

from functools import cache
from typing import Any

from stsem.errors import MissingExtraError


def definition(type_name: str) -> str | None:
    """Text of a type such as `sensor_msgs/msg/Image`, with all that it is made of; None of a type that is not known.

    The types are those of ROS 2 Humble, the last release whose bags have no definitions, then those of today.

    Raises:
        MissingExtraError: the extra `convert` is not installed.
    """
    return next((text for store in _stores() if (text := _in_store(store, type_name)) is not None), None)


def _in_store(store: Any, type_name: str) -> str | None:
    from rosbags.typesys import TypesysError

    try:
        return str(store.generate_msgdef(type_name, ros_version=2)[0])
    except (TypesysError, KeyError):
        return None


@cache
def _stores() -> tuple[Any, ...]:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as err:
        raise MissingExtraError("convert", "A ROS 2 bag that does not hold its message definitions") from err
    return get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.LATEST)
