"""The pose graph: derivatives, known minima, false loops, repeatability."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from stsem.pose import inverse
from stsem.slam.posegraph import Edge, jacobians, moved, relax, residuals
from stsem.slam.rotations import exponential
from tests.slam.made_up_graph import INFORMATION, graph


def test_jacobians_are_the_derivatives() -> None:
    """Against central differences, at residuals that are far from zero."""
    made = graph(12, 4, false=3, seed=1)
    of_first, of_second = jacobians(made.start, made.edges)
    for edge in range(len(made.edges)):
        for node, found in ((made.edges[edge].first, of_first), (made.edges[edge].second, of_second)):
            for k in range(6):
                step = np.zeros((len(made.start), 6))
                step[node, k] = 1e-6
                ends = [residuals(moved(made.start, s), made.edges)[edge] for s in (step, -step)]
                assert found[edge, :, k] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-7)


def test_exact_measurements_give_the_truth() -> None:
    """Without noise the minimum is zero, also from a wrong start; the fixed node stays where it is."""
    made = graph(40, 6, noise=0.0)
    wrong = moved(made.truth, np.random.default_rng(5).normal(0, 0.1, (40, 6)))
    wrong[7] = made.truth[7]
    found = relax(wrong, made.edges, fixed=7)
    assert found.poses == pytest.approx(made.truth, abs=1e-6)
    assert found.poses[7].tobytes() == made.truth[7].tobytes()
    assert found.converged
    assert found.cost < 1e-6


def test_the_minimum_is_that_of_a_general_solver() -> None:
    """scipy's least squares, which knows nothing of our derivatives, ends at the same cost and poses."""
    made = graph(18, 3, seed=4)
    edges = [Edge(e.first, e.second, e.T, e.information) for e in made.edges]
    root = np.linalg.cholesky(INFORMATION)

    def weighted(x: np.ndarray) -> np.ndarray:
        return (residuals(moved(made.start, np.concatenate([np.zeros(6), x]).reshape(-1, 6)), edges) @ root).ravel()

    wanted = least_squares(weighted, np.zeros(102), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = relax(made.start, edges)
    assert found.cost == pytest.approx(2 * wanted.cost, rel=1e-6)
    best = moved(made.start, np.concatenate([np.zeros(6), wanted.x]).reshape(-1, 6))
    assert found.poses == pytest.approx(best, abs=1e-5)


def test_a_closed_square_shares_its_error() -> None:
    """Four sides of 1 m, one measured 4 cm too long: each takes a quarter: two in length, two by shear."""
    corner = np.eye(4)
    corner[:3, :3], corner[0, 3] = exponential(np.array([0, 0, np.pi / 2])), 1.0
    longer = corner.copy()
    longer[0, 3] = 1.04
    stiff = np.diag([1.0] * 3 + [1e8] * 3)  # no turning: the error goes into the lengths
    edges = [Edge(i, (i + 1) % 4, longer if i == 0 else corner, stiff) for i in range(4)]
    start = [np.eye(4)]
    for edge in edges[:3]:
        start.append(start[-1] @ edge.T)
    found = relax(np.array(start), edges)
    lengths = [np.linalg.norm((found.poses[e.second] - found.poses[e.first])[:3, 3]) for e in edges]
    assert lengths == pytest.approx([1.03, 1.00005, 1.01, 1.00005], abs=1e-6)


@pytest.mark.parametrize("false", [0, 5, 20])
@pytest.mark.parametrize("seed", range(3))
def test_false_loops_are_given_up(false: int, seed: int) -> None:
    """As many false loops as true ones: all false ones lose their weight, the result is that of the true ones."""
    made = graph(150, 20, false=false, seed=seed)
    true = made.edges[: len(made.edges) - false]
    found = relax(made.start, made.edges)
    weights = found.weights[[edge.is_loop for edge in made.edges]]
    assert weights[:20].min() > 0.5
    assert weights[20:].max(initial=0) < 1e-3
    assert made.error_m(found.poses) < 0.5 * made.error_m(made.start)
    assert found.poses == pytest.approx(relax(made.start, true).poses, abs=1e-3)


def test_a_wrong_odometry_edge_counts_less() -> None:
    """Huber: an edge of odometry that is off by a metre is overruled by two that are not."""
    made = graph(6, 0, noise=0.0)
    bad = made.edges[2].T.copy()
    bad[0, 3] += 1.0
    found = relax(made.truth, [*made.edges, made.edges[2], Edge(2, 3, bad, INFORMATION)])
    assert found.weights[-1] < 0.05
    assert made.error_m(found.poses) < 0.03


def test_repeats_to_the_bit() -> None:
    made = graph(60, 10, false=3, seed=2)
    assert relax(made.start, made.edges).poses.tobytes() == relax(made.start.copy(), made.edges).poses.tobytes()


def test_nothing_to_relax_and_what_cannot_be() -> None:
    assert relax(np.eye(4)[None], []).poses.tolist() == np.eye(4)[None].tolist()
    with pytest.raises(ValueError, match="joins two of 2 nodes"):
        relax(np.tile(np.eye(4), (2, 1, 1)), [Edge(0, 2, np.eye(4), INFORMATION)])
    with pytest.raises(ValueError, match="but 1 and 1 came"):
        relax(np.tile(np.eye(4), (2, 1, 1)), [Edge(1, 1, np.eye(4), INFORMATION)])


def test_a_node_without_edges_stays() -> None:
    made = graph(5, 0, noise=0.0)
    alone = np.concatenate([made.truth, inverse(made.truth[2])[None]])
    assert relax(alone, made.edges).poses == pytest.approx(alone, abs=1e-9)
