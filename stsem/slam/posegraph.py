"""A graph of poses and measured motions between them, relaxed (Grisetti, Kuemmerle, Stachniss, Burgard 2010).

Minimises sum rho(r^T Omega r) over the edges by Levenberg-Marquardt, with r = (R_Z^T (R_I^T (t_J - t_I) - t_Z),
log(R_Z^T R_I^T R_J)) for an edge that measured T_IJ = Z, and steps t <- t + R d, R <- R exp(w). rho is Huber's for
edges of odometry and that of dynamic covariance scaling (Agarwal et al. 2013) for loops, which may be false.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from stsem.pose import Pose
from stsem.slam.rotations import F64, exponential, inverse_right_jacobian, logarithm, skew

HUBER = 3.0
"""Residuals, in standard deviations, from which an edge of odometry counts linearly."""

LOOP_PHI = 16.0
"""Squared residual, in variances of six numbers, from which a loop loses weight: exceeded by 1.4 % of true ones."""

ANNEALING = 8.0
"""By how much the scale of the loops' loss shrinks from one round to the next (Yang et al. 2020, section IV)."""

MAX_ROUNDS = 4

STEPS_PER_ROUND = 3
"""Before the last round: where false loops pull too there is no rest worth finding."""


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured motion between two nodes.

    Args:
        first, second: indices of nodes I and J.
        T: (4, 4) pose of J in I, T_IJ = T_WI^-1 T_WJ.
        information: (6, 6) inverse covariance of the error in the axes of J: translation (1/m^2), rotation (1/rad^2).
        is_loop: it may be false, and then must not bend the rest.
    """

    first: int
    second: int
    T: Pose
    information: F64
    is_loop: bool = False


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A graph at rest.

    Args:
        poses: (n, 4, 4) T_WC of the nodes; that of the fixed node is what came.
        weights: (edges,) 0..1: how much each edge counts in the end; a loop well below 0.5 contradicts the rest.
        cost: sum of rho over the edges.
        iterations: linear systems solved.
        converged: the last steps were small; False when the iterations ran out.
    """

    poses: F64
    weights: F64
    cost: float
    iterations: int
    converged: bool


@dataclass(frozen=True, eq=False)
class _Edges:
    """The edges as arrays, one row each."""

    first: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    R: F64
    t: F64
    information: F64
    is_loop: npt.NDArray[np.bool_]


def relax(
    poses: F64, edges: Sequence[Edge], *, fixed: int = 0, max_iterations: int = 60, tolerance: float = 1e-7
) -> Relaxed:
    """The poses (n, 4, 4) that agree best with the edges; nodes without a way to `fixed` keep near where they were.

    Loops start with a loss so wide that all of them pull, and it is narrowed round by round, so that a true loop is
    not given up for the drift that it is there to mend.

    Args:
        poses: T_WC to start from.
        edges: motions measured; two nodes may have several.
        fixed: the node that stays: edges say nothing about where the whole is.
        max_iterations: linear systems of the last round.
        tolerance: a step below it, in metres and radians, ends a round (of all but the last a thousand times that).

    Raises:
        ValueError: an edge names a node that is not there, or joins one to itself.
    """
    if not edges or len(poses) < 2:
        return Relaxed(poses.copy(), np.ones(len(edges)), 0.0, 0, True)
    table = _stacked(edges, len(poses))
    pattern = _Pattern(table, len(poses), fixed)
    solver = _Solver(table, pattern, poses)
    for scale in _scales(solver):
        last = scale == 1
        solver.descend(scale, tolerance if last else 1e3 * tolerance, max_iterations if last else STEPS_PER_ROUND)
    return Relaxed(solver.poses, solver.weights(1.0), solver.cost, solver.iterations, solver.converged)


def residuals(poses: F64, edges: Sequence[Edge]) -> F64:
    """(edges, 6) translation in metres and rotation in radians by which the poses differ from what was measured."""
    return _residuals(poses, _stacked(edges, len(poses)))


def jacobians(poses: F64, edges: Sequence[Edge]) -> tuple[F64, F64]:
    """Derivatives (edges, 6, 6) of `residuals` by steps (translation, rotation) of the first and the second node."""
    table = _stacked(edges, len(poses))
    return _jacobians(poses, table, _residuals(poses, table))


def moved(poses: F64, steps: F64) -> F64:
    """Poses (n, 4, 4) after steps (n, 6) in their own axes: t + R d, R exp(w)."""
    result = poses.copy()
    result[:, :3, 3] += np.einsum("nij,nj->ni", poses[:, :3, :3], steps[:, :3])
    result[:, :3, :3] = poses[:, :3, :3] @ exponential(steps[:, 3:])
    return result


class _Solver:
    """Levenberg-Marquardt on one graph; `poses` are the best so far."""

    def __init__(self, edges: _Edges, pattern: "_Pattern", poses: F64) -> None:
        self.poses = poses.copy()
        self.cost, self.iterations, self.converged = 0.0, 0, False
        self._edges, self._pattern, self._damping = edges, pattern, 1e-6
        self._errors = _residuals(self.poses, edges)

    def chi2(self, errors: F64 | None = None) -> F64:
        """(edges,) squared residuals in variances."""
        r = self._errors if errors is None else errors
        return np.asarray(np.einsum("ei,eij,ej->e", r, self._edges.information, r))

    def weights(self, scale: float) -> F64:
        """(edges,) rho' at the squared residuals."""
        return _loss(self.chi2(), self._edges.is_loop, scale)[1]

    def descend(self, scale: float, tolerance: float, max_iterations: int) -> None:
        """Step until steps are smaller than `tolerance`, nothing gets better, or the iterations are used up."""
        self.cost, self.converged = float(_loss(self.chi2(), self._edges.is_loop, scale)[0].sum()), False
        for _ in range(max_iterations):
            steps = self._steps(scale)
            self.iterations += 1
            poses = moved(self.poses, steps)
            errors = _residuals(poses, self._edges)
            cost = float(_loss(self.chi2(errors), self._edges.is_loop, scale)[0].sum())
            self.converged = float(np.abs(steps).max()) < tolerance or abs(self.cost - cost) <= 1e-12 * self.cost
            if cost <= self.cost:
                self.poses, self._errors, self.cost = poses, errors, cost
                self._damping = max(self._damping / 10, 1e-9)
            else:
                self._damping *= 10
                self.converged = self._damping > 1e6
            if self.converged:
                return

    def _steps(self, scale: float) -> F64:
        of_first, of_second = _jacobians(self.poses, self._edges, self._errors)
        weighted = self._edges.information * self.weights(scale)[:, None, None]
        return self._pattern.solve(of_first, of_second, weighted, self._errors, self._damping)


class _Pattern:
    """Where the blocks of the normal equations stand; the same in all iterations."""

    def __init__(self, edges: _Edges, nodes: int, fixed: int) -> None:
        self._nodes, self._fixed = nodes, fixed
        i, j = edges.first, edges.second
        rows, columns = np.concatenate([i, i, j, j]), np.concatenate([i, j, i, j])
        self._kept = (rows != fixed) & (columns != fixed)
        place = np.arange(nodes) - (np.arange(nodes) > fixed)
        rows, columns = place[rows[self._kept]], place[columns[self._kept]]
        self._rows = (6 * rows[:, None, None] + np.arange(6)[:, None] + np.zeros(6, np.intp)).ravel()
        self._columns = (6 * columns[:, None, None] + np.arange(6) + np.zeros((6, 1), np.intp)).ravel()
        self._diagonal = np.arange(6 * (nodes - 1))
        self._first, self._second = i, j

    def solve(self, A: F64, B: F64, information: F64, errors: F64, damping: float) -> F64:
        """Steps (nodes, 6) of (H + damping diag(H)) x = -b with H = sum J^T Omega J, b = sum J^T Omega r."""
        At, Bt = np.swapaxes(A, 1, 2) @ information, np.swapaxes(B, 1, 2) @ information
        blocks = np.concatenate([At @ A, At @ B, Bt @ A, Bt @ B])[self._kept]
        size = 6 * (self._nodes - 1)
        H = csc_matrix((blocks.ravel(), (self._rows, self._columns)), shape=(size, size))
        b = np.zeros((self._nodes, 6))
        np.add.at(b, self._first, (At @ errors[..., None])[..., 0])
        np.add.at(b, self._second, (Bt @ errors[..., None])[..., 0])
        H = H + csc_matrix((damping * H.diagonal() + 1e-9, (self._diagonal, self._diagonal)), shape=(size, size))
        options = {"SymmetricMode": True}
        factor = splu(H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        steps = np.insert(factor.solve(-np.delete(b, self._fixed, axis=0).ravel()), [6 * self._fixed] * 6, 0.0)
        return np.asarray(steps.reshape(-1, 6))


def _stacked(edges: Sequence[Edge], nodes: int) -> _Edges:
    for edge in edges:
        if edge.first == edge.second or not (0 <= edge.first < nodes and 0 <= edge.second < nodes):
            raise ValueError(f"an edge joins two of {nodes} nodes, but {edge.first} and {edge.second} came")
    T = np.array([edge.T for edge in edges])
    return _Edges(
        np.array([edge.first for edge in edges]), np.array([edge.second for edge in edges]), T[:, :3, :3], T[:, :3, 3],
        np.array([edge.information for edge in edges]), np.array([edge.is_loop for edge in edges]),
    )  # fmt: skip


def _scales(solver: _Solver) -> list[float]:
    """Scales of the loops' loss, from one that holds half of the loops inside down to 1."""
    loops = solver.chi2()[solver._edges.is_loop]
    start = float(np.median(loops)) / LOOP_PHI if len(loops) else 1.0
    rounds = int(np.clip(np.ceil(np.log(max(start, 1.0)) / np.log(ANNEALING)), 0, MAX_ROUNDS))
    return [ANNEALING**k for k in range(rounds, -1, -1)]


def _loss(chi2: F64, is_loop: npt.NDArray[np.bool_], scale: float) -> tuple[F64, F64]:
    """rho and rho' (edges,): Huber's, and for loops 3 P - 4 P^2 / (P + chi2) above P = LOOP_PHI scale, chi2 below."""
    root = np.sqrt(np.maximum(chi2, HUBER**2))
    phi = LOOP_PHI * scale
    share = np.minimum(1.0, 2 * phi / (phi + chi2))  # Agarwal 2013, equation 15
    inside = (chi2 <= HUBER**2) | (scale > 1)  # while false loops still pull, odometry must not give way to them
    rho = np.where(inside, chi2, 2 * HUBER * root - HUBER**2)
    loop_rho = np.where(chi2 <= phi, chi2, 3 * phi - 4 * phi * phi / (phi + chi2))
    return np.where(is_loop, loop_rho, rho), np.where(is_loop, share * share, np.where(inside, 1.0, HUBER / root))


def _residuals(poses: F64, edges: _Edges) -> F64:
    of_first, of_second = poses[edges.first], poses[edges.second]
    Rt, Zt = np.swapaxes(of_first[:, :3, :3], 1, 2), np.swapaxes(edges.R, 1, 2)
    t = Rt @ (of_second[:, :3, 3] - of_first[:, :3, 3])[..., None] - edges.t[..., None]
    return np.concatenate([(Zt @ t)[..., 0], logarithm(Zt @ Rt @ of_second[:, :3, :3])], axis=1)


def _jacobians(poses: F64, edges: _Edges, errors: F64) -> tuple[F64, F64]:
    of_first, of_second = poses[edges.first], poses[edges.second]
    Rt, Zt = np.swapaxes(of_first[:, :3, :3], 1, 2), np.swapaxes(edges.R, 1, 2)
    R_ij = Rt @ of_second[:, :3, :3]
    t_ij = (Rt @ (of_second[:, :3, 3] - of_first[:, :3, 3])[..., None])[..., 0]
    Jr = inverse_right_jacobian(errors[:, 3:])
    A, B = np.zeros((2, len(errors), 6, 6))
    A[:, :3, :3], A[:, :3, 3:], A[:, 3:, 3:] = -Zt, Zt @ skew(t_ij), -Jr @ np.swapaxes(R_ij, 1, 2)
    B[:, :3, :3], B[:, 3:, 3:] = Zt @ R_ij, Jr
    return A, B
