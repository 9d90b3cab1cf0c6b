"""Which frames of a sequence become training pairs; the same for logs and folders."""

from collections.abc import Sequence


def consecutive(labelled: Sequence[bool]) -> list[tuple[int, int]]:
    """(earlier, later) frame of every pair: each labelled frame with the one before it.

    A labelled first frame that is in no other pair comes with the frame behind it, or alone with itself.

    Args:
        labelled: whether each frame of a sequence, in its order, has truth; those without serve as partners.
    """
    pairs = [(k - 1, k) for k in range(1, len(labelled)) if labelled[k]]
    if labelled and labelled[0] and (0, 1) not in pairs[:1]:
        pairs.insert(0, (0, min(1, len(labelled) - 1)))
    return pairs
