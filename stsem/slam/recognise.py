"""Which keyframes look like the current image: votes of its strongest points."""

from collections.abc import Sequence

import cv2
import numpy as np

from stsem.slam.landmarks import MAX_DISTANCE, Landmarks

VOTERS = 200


def most_alike(current: Landmarks, keyframes: Sequence[Landmarks], count: int) -> list[int]:
    """Positions of at most `count` keyframes, most votes first, then newest; those with a vote only.

    Each of the first points of the image votes for the keyframe that holds its nearest descriptor.
    """
    sizes = np.array([len(one) for one in keyframes])
    if not len(current) or not sizes.sum():
        return []
    owners = np.repeat(np.arange(len(keyframes)), sizes)
    stored = np.concatenate([one.descriptors for one in keyframes])
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).match(current.descriptors[:VOTERS], stored)
    voted = [owners[pair.trainIdx] for pair in pairs if pair.distance < MAX_DISTANCE]
    votes = np.bincount(voted, minlength=len(keyframes)) if voted else np.zeros(len(keyframes), np.int64)
    order = np.lexsort((-np.arange(len(keyframes)), -votes))
    return [int(one) for one in order[:count] if votes[one] > 0]
