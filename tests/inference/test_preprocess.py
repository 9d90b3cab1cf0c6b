"""Inputs by hand-worked numbers."""

from dataclasses import replace

import numpy as np
import pytest

from stsem.classes import ClassSet
from stsem.errors import UsageError
from stsem.inference import cpu
from stsem.inference.cpu import cpu_features
from stsem.inference.preprocess import depth_input, labels_at, network_inputs, stretched
from stsem.inference.sidecar import DepthForm, Difference, Sidecar
from stsem.inference.threads import set_threads

SIDECAR = Sidecar((4, 2), (0.5, 0.25, 0.0), (0.5, 0.25, 1.0), ClassSet(("a",)), Difference(3.0))


def test_inputs_by_hand() -> None:
    """(value / 255 - mean) / std per channel, and scale (current - previous) / 255."""
    image, previous = np.full((2, 4, 3), (255, 0, 51), np.uint8), np.full((2, 4, 3), (0, 51, 51), np.uint8)
    inputs = network_inputs(image, previous, SIDECAR)
    assert inputs["image"].shape == inputs["difference"].shape == (1, 3, 2, 4)
    assert inputs["image"].dtype == inputs["difference"].dtype == np.float32
    assert inputs["image"][0, :, 1, 3] == pytest.approx([1.0, -1.0, 0.2])
    assert inputs["difference"][0, :, 0, 0] == pytest.approx([3.0, -0.6, 0.0])


def test_without_a_previous_frame_the_difference_is_zero() -> None:
    """As for the first frame of a log."""
    assert not network_inputs(np.full((2, 4, 3), 9, np.uint8), None, SIDECAR)["difference"].any()


def test_a_previous_frame_of_another_size_is_stretched() -> None:
    """A log may change its resolution on the way."""
    inputs = network_inputs(np.full((2, 4, 3), 9, np.uint8), np.full((8, 16, 3), 9, np.uint8), SIDECAR)
    assert not inputs["difference"].any()


def test_depth_by_hand() -> None:
    """Scaled metres of the nearest pixel: no value lies between the two of an edge; unknown is what the form says."""
    depth = np.array([[1, 1, 9, 9], [1, 1, 9, np.nan]], np.float32)
    assert depth_input(depth, DepthForm(), (4, 2)).tolist() == [[[1, 1, 9, 9], [1, 1, 9, 0]]]
    assert depth_input(depth, DepthForm(0.5, -1.0), (2, 2)).tolist() == [[[0.5, 4.5], [0.5, -1]]]
    larger = depth_input(depth, DepthForm(), (7, 5))
    assert larger.dtype == np.float32
    assert set(larger.flat) == {0, 1, 9}


def test_the_depth_of_a_frame_without_one_is_unknown_all_over() -> None:
    """Also in a network's inputs; without a section there is no such input, whatever the frame has."""
    image, depth = np.zeros((2, 4, 3), np.uint8), np.ones((2, 4), np.float32)
    with_depth = replace(SIDECAR, depth=DepthForm(2.0, 0.25))
    assert (network_inputs(image, None, with_depth)["depth"] == 0.25).all()
    inputs = network_inputs(image, None, with_depth, depth)
    assert inputs["depth"].shape == (1, 1, 2, 4)
    assert (inputs["depth"] == 2).all()
    assert network_inputs(image, None, SIDECAR, depth).keys() == {"image", "difference"}


def test_stretching_is_bilinear_with_aligned_centres() -> None:
    """Halving a row averages neighbours."""
    row = np.array([0, 100, 40, 60], np.uint8)[None, :, None].repeat(3, 2).repeat(2, 0)
    assert stretched(row, (2, 1))[0, :, 0].tolist() == [50, 50]


def test_labels_keep_their_values_and_places() -> None:
    """Doubling repeats each label; there and back is the identity."""
    labels = np.array([[0, 7], [255, 3]], np.uint8)
    assert labels_at(labels, (4, 4)).tolist() == [[0, 0, 7, 7], [0, 0, 7, 7], [255, 255, 3, 3], [255, 255, 3, 3]]
    assert labels_at(labels_at(labels, (6, 4)), (2, 2)).tolist() == labels.tolist()


def test_thread_counts_reach_the_libraries() -> None:
    """OpenCV takes the count; zero is refused."""
    import cv2

    before = cv2.getNumThreads()
    set_threads(1)
    assert cv2.getNumThreads() == 1
    set_threads(before)
    with pytest.raises(UsageError, match="at least 1"):
        set_threads(0)


def test_cpu_features_are_vector_instructions_only() -> None:
    """Flags that do not change floats (smep, fpu) stay out; both kinds of /proc/cpuinfo are read."""
    x86 = "processor : 0\nflags\t\t: fpu smep sse2 avx512f fma ht\n\nflags : never\n"
    arm = "processor : 0\nFeatures\t: fp asimd sve2 i8mm crc32\n"
    assert cpu._from_cpuinfo(x86) == {"sse2", "avx512f", "fma"}
    assert cpu._from_cpuinfo(arm) == {"asimd", "sve2", "i8mm"}
    assert cpu._from_cpuinfo("nothing here") == set()
    assert cpu._from_numpy()
    assert cpu_features() == cpu_features()
