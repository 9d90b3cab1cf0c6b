"""A frame in cells: place, direction and looks of each, against numpy over its pixels."""

import cv2
import numpy as np
import pytest

from stsem.camera import Camera
from stsem.chance import generator
from stsem.frame import Depth, Image
from stsem.geometry.cells import CELLS, LIGHTNESS, described, lightened
from stsem.geometry.reproject import View
from stsem.pose import Pose

WIDTH, HEIGHT, SIDE = 485, 27, 4
CAMERA = Camera(WIDTH, HEIGHT, 300.0, 310.0, 240.0, 14.0)
ROWS, COLUMNS = HEIGHT // SIDE, WIDTH // SIDE


def posed() -> Pose:
    """Turned about its z axis and moved."""
    T = np.eye(4)
    T[:2, :2], T[:3, 3] = [[0.8, -0.6], [0.6, 0.8]], (5.0, -2.0, 1.0)
    return T


def depths() -> Depth:
    return 1 + generator(0, "depths").random((HEIGHT, WIDTH), np.float32)


def noise() -> Image:
    return generator(0, "image").integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)


def test_texture_is_the_standard_deviation_of_grey_over_a_cell() -> None:
    """Cell by cell; the pixels that fill no cell have no say."""
    image = noise()
    image[:, 100:200] = image[:, 100:200] // 16
    image[:, 300:] = 255
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    found = described(View(depths(), np.eye(4), CAMERA), image).texture
    assert found.shape == (ROWS, COLUMNS)
    for y, x in np.ndindex(ROWS, COLUMNS):
        cell = grey[y * SIDE : (y + 1) * SIDE, x * SIDE : (x + 1) * SIDE]
        assert found[y, x] == pytest.approx(cell.astype(np.float64).std(), abs=0.01)


def test_colour_is_the_mean_over_a_cell_with_lightness_weighed() -> None:
    """To the rounding of 8 bits."""
    image = noise()
    cells = image[: ROWS * SIDE, : COLUMNS * SIDE].reshape(ROWS, SIDE, COLUMNS, SIDE, 3)
    mean = np.rint(cells.mean(axis=(1, 3))).astype(np.uint8)
    lab = cv2.cvtColor(mean, cv2.COLOR_RGB2LAB).astype(np.float64)
    assert lightened(mean) == pytest.approx(lab * (LIGHTNESS, 1, 1))
    found = described(View(depths(), np.eye(4), CAMERA), image).colour
    assert np.abs(found - lab * (LIGHTNESS, 1, 1)).max() <= 2


def test_place_is_that_of_the_pixel_in_the_middle() -> None:
    """By the equation of the camera, in the world; NaN where its depth is unknown, by NaN or 0."""
    depth, T = depths(), posed()
    depth[:, :100], depth[:, 100:200] = np.nan, 0
    cells = described(View(depth, T, CAMERA), noise())
    assert (cells.known == (np.arange(COLUMNS) >= 50)).all()
    assert np.isnan(cells.place[~cells.known]).all()
    for y, x in np.argwhere(cells.known):
        v, u = y * SIDE + SIDE // 2, x * SIDE + SIDE // 2
        z = float(depth[v, u])
        point = np.array([(u - 240) / 300 * z, (v - 14) / 310 * z, z])
        assert cells.depth[y, x] == depth[v, u]
        assert cells.place[y, x] == pytest.approx(T[:3, :3] @ point + T[:3, 3], abs=1e-5)


def test_normals_are_those_of_the_plane_towards_the_camera() -> None:
    """Of a tilted one, seen from a turned camera; none at the neighbours of a cell without depth, and at no others."""
    T, normal = posed(), np.array([0.3, 0.2, -0.9]) / np.linalg.norm([0.3, 0.2, -0.9])
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    rays = np.stack([(u - 240) / 300, (v - 14) / 310, np.ones(u.shape)], axis=2)
    depth = (-2 / (rays @ normal)).astype(np.float32)
    depth[3 * SIDE + SIDE // 2, 50 * SIDE + SIDE // 2] = np.nan
    found = described(View(depth, T, CAMERA), noise()).normal
    none = (found == 0).all(axis=2)
    assert sorted(map(tuple, np.argwhere(none))) == [(2, 50), (3, 49), (3, 51), (4, 50)]
    np.testing.assert_allclose(found[~none], np.broadcast_to(T[:3, :3] @ normal, found[~none].shape), atol=2e-3)


def test_up_is_where_the_top_of_the_image_is() -> None:
    """One pixel up in the image is a step along it."""
    T = posed()
    cells = described(View(np.ones((HEIGHT, WIDTH), np.float32), T, CAMERA), noise())
    step = cells.place[2, 60] - cells.place[3, 60]
    assert step / np.linalg.norm(step) == pytest.approx(cells.up, abs=1e-4)


def test_the_middles_are_the_same_whether_cut_out_or_counted() -> None:
    cells, some = described(View(depths(), np.eye(4), CAMERA), noise()), generator(0, "some").random((ROWS, COLUMNS))
    numbers = np.arange(WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)
    middles = cells.middles(numbers)
    assert middles.shape == (ROWS, COLUMNS)
    assert middles[2, 5] == (2 * SIDE + 2) * WIDTH + 5 * SIDE + 2
    np.testing.assert_array_equal(cells.pixels(some < 0.5), middles[some < 0.5])


def test_an_image_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="size of its depth"):
        described(View(depths(), np.eye(4), CAMERA), noise()[:-1])


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (121, 3), (3, 300), (250, 187), (960, 540)])
def test_cells_of_any_size_cover_the_image(size: tuple[int, int]) -> None:
    """All but the last pixels, fewer than a cell; and there are never many cells."""
    width, height = size
    camera = Camera(width, height, 60.0, 60.0, width / 2, height / 2)
    view, image = View(np.ones((height, width), np.float32), np.eye(4), camera), np.zeros((height, width, 3), np.uint8)
    cells = described(view, image)
    rows, columns = cells.known.shape
    assert 0 <= height - rows * cells.side < cells.side
    assert 0 <= width - columns * cells.side < cells.side
    assert max(rows, columns) <= 2 * CELLS
    assert cells.known.all()
    assert cells.place.shape == cells.normal.shape == cells.colour.shape == (rows, columns, 3)
