"""How large an image may be: checked on what its header states, before anything of that size is allocated."""

MAX_PIXELS = 1 << 25
"""More than any robot's camera has; decoded to colour they are 96 MiB."""

Size = tuple[int, int]


def check_size(width: int, height: int, expected: Size | None = None) -> None:
    """Refuse what no camera makes, and what differs from the (width, height) that the caller expects.

    Raises:
        ValueError: the size cannot be, or is another than `expected`.
    """
    if width <= 0 or height <= 0:
        raise ValueError(f"a size of {width}x{height} cannot be")
    if width * height > MAX_PIXELS:
        raise ValueError(f"the image is {width}x{height}, but {MAX_PIXELS >> 20} million pixels are the most allowed")
    if expected is not None and (width, height) != expected:
        raise ValueError(f"the image is {width}x{height}, but {expected[0]}x{expected[1]} is expected")
