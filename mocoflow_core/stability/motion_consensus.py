"""There and back between moments that are far apart, in contact, or collapsed."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.body.rigid_controls import rigid_controls
from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.fields.body_lattices import BodyMotionConfig, build_body_motion
from mocoflow_core.fields.motion_body import BodyMotion
from mocoflow_core.fields.signed_distance_prior import SignedDistancePrior
from mocoflow_core.geometry.se3 import transform_points
from mocoflow_core.losses.motion_consensus import Move, global_consensus, local_consensus
from mocoflow_core.stability.case import Case, Found, require
from mocoflow_core.stability.figures import ARM, TORSO, swung, torso_and_arm, turned

SINGLE = torch.finfo(torch.float32).eps
REACH_M = 0.06
LATTICE = BodyMotionConfig()
AXIS = torch.tensor([2.0, -3.0, 6.0]) / 7.0


def _moves_of(twists: Tensor) -> tuple[Move, Move]:
    """Exact inverses: one twist (G, 6) for each moment."""

    def to_canonical(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        return transform_points(-twists[row], points), torch.ones(len(points), dtype=torch.bool)

    def to_observed(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        return transform_points(twists[row], points), torch.ones(len(points), dtype=torch.bool)

    return to_canonical, to_observed


def _points(count: int) -> Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(0)) - 1


def _exact_inverses(degrees: float) -> Found:
    omega = math.radians(degrees) * AXIS
    shift = torch.tensor([0.3, -0.7, 1.1])
    twists = torch.stack([torch.cat([-0.5 * omega, shift]), torch.cat([omega, -shift])])
    twists.requires_grad_()
    points = _points(200)
    row = torch.zeros(200, dtype=torch.int64)
    moves = _moves_of(twists)
    local = local_consensus(*moves, points, row)
    far = global_consensus(*moves, points, row, row + 1)
    (local + far).backward()
    gradient = twists.grad
    assert gradient is not None
    return Found(max(float(local.detach()), float(far.detach())), (gradient,))


def _empty(count: float) -> Found:
    """A selection of no points is worth exactly nothing, and pulls nowhere."""
    twists = torch.randn(2, 6, generator=torch.Generator().manual_seed(0)).requires_grad_()
    points = _points(int(count))
    row = torch.zeros(len(points), dtype=torch.int64)
    moves = _moves_of(twists)
    loss = local_consensus(*moves, points, row) + global_consensus(*moves, points, row, row + 1)
    loss.backward()
    gradient = twists.grad
    assert gradient is not None
    if count == 0:
        require(float(loss.detach()) == 0.0 and not gradient.any(), "nothing pulls somewhere")
    return Found(float(loss.detach()), (gradient,))


def _half_precision(count: float) -> Found:
    """Every point is off by 0.75 m in half precision: the mean must be that, however many."""

    def shifted(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        return points + 0.25, torch.ones(len(points), dtype=torch.bool)

    def same(points: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
        return points, torch.ones(len(points), dtype=torch.bool)

    points = torch.zeros(int(count), 3, dtype=torch.float16)
    row = torch.zeros(len(points), dtype=torch.int64)
    return Found(abs(float(local_consensus(shifted, same, points, row)) - 0.75))


def _motion(canonical: NDArray[np.float32], frames: list[NDArray[np.float32]]) -> BodyMotion:
    _, faces = torso_and_arm()
    controls = rigid_controls(
        canonical,
        np.stack(frames),
        faces,
        np.linspace(0, 1, len(frames)),
        LATTICE.control_spacing_m,
        LATTICE.neighbours,
    )
    origin, lattice = signed_distance_lattice(canonical, faces, 0.03, 0.15)
    prior = SignedDistancePrior(torch.from_numpy(lattice), torch.from_numpy(origin), 0.03)
    return build_body_motion(controls, prior, REACH_M, LATTICE)


def _loss_between(motion: BodyMotion, points: NDArray[np.float32]) -> Found:
    at = torch.from_numpy(points).requires_grad_()
    row = torch.zeros(len(at), dtype=torch.int64)
    moves = motion.to_canonical, motion.to_observed
    local = local_consensus(*moves, at, row)
    far = global_consensus(*moves, at, row, row + 1)
    (local + far).backward()
    gradient = at.grad
    assert gradient is not None
    return Found(max(float(local.detach()), float(far.detach())), (gradient,))


def _turned_body(degrees: float) -> Found:
    canonical, _ = torso_and_arm()
    frames = [canonical, turned(canonical, degrees)]
    return _loss_between(_motion(canonical, frames), canonical)


def _fast_limb(degrees: float) -> Found:
    canonical, _ = torso_and_arm()
    frames = [swung(canonical, -0.5 * degrees), swung(canonical, 0.5 * degrees)]
    return _loss_between(_motion(canonical, frames), frames[0])


def _contact(gap_m: float) -> Found:
    """The arm hangs ``gap_m`` beside the torso in the canonical frame, and is lifted later."""
    rest, _ = torso_and_arm()
    canonical = swung(rest, 90.0)
    canonical[ARM] += np.array([gap_m, 0.0, 0.0], np.float32) - _overlap(canonical)
    lifted = [canonical.copy(), canonical.copy()]
    lifted[0][ARM] += np.array([0.3, 0.0, 0.0], np.float32)
    lifted[1][ARM] += np.array([0.3, 0.0, 0.4], np.float32)
    return _loss_between(_motion(canonical, lifted), lifted[0])


def _overlap(body: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far (3,) along x the arm must be moved to touch the torso from outside."""
    return np.array([body[ARM][:, 0].min() - body[TORSO][:, 0].max(), 0, 0], np.float32)


def _collapsed(scale: float) -> Found:
    """In one frame the whole body is squeezed to a slab: no map leads back to its shape."""
    canonical, _ = torso_and_arm()
    squeezed = canonical * np.array([1.0, scale, 1.0], np.float32)
    return _loss_between(_motion(canonical, [canonical, squeezed]), canonical)


def _chain(hops: float) -> Found:
    """A point sent through many moments and back, against what one round trip allows.

    Through k round trips an error of eps each grows to at most eps (L^k - 1) / (L - 1), where L is
    the Lipschitz constant of a round trip, measured where the chain passes.
    """
    canonical, _ = torso_and_arm()
    frames = [swung(canonical, degrees) for degrees in (-40.0, -10.0, 25.0, 50.0)]
    motion = _motion(canonical, frames)
    start = torch.from_numpy(canonical)
    point, eps, lipschitz = start, 0.0, 1.0
    for hop in range(int(hops)):
        row = torch.full((len(start),), hop % len(frames))
        at = point.detach().requires_grad_()
        there, _ = motion.to_observed(at, row)
        back, _ = motion.to_canonical(there, row)
        eps = max(eps, _round_trip_error(motion, start, row))
        lipschitz = max(lipschitz, _stretch(back, at))
        point = back.detach()
    error = float((point - start).norm(dim=-1).max())
    grown = lipschitz - 1.0
    allowed = eps * (hops if grown < 1e-6 else (lipschitz**hops - 1.0) / grown)
    words = f"{1000 * error:.3g} mm; eps {1000 * eps:.3g} mm, L {lipschitz:.3f}"
    return Found(error / max(allowed, SINGLE), (point,), words)


def _round_trip_error(motion: BodyMotion, start: Tensor, row: Tensor) -> float:
    there, _ = motion.to_observed(start, row)
    back, _ = motion.to_canonical(there, row)
    return float((back - start).norm(dim=-1).max())


def _stretch(moved: Tensor, points: Tensor) -> float:
    """Largest factor by which the map stretches a small step at any of the points."""
    rows = [
        torch.autograd.grad(moved[:, axis].sum(), points, retain_graph=True)[0] for axis in range(3)
    ]
    return float(torch.linalg.matrix_norm(torch.stack(rows, 1), ord=2).max())


_CELL = LATTICE.node_spacing_m
_ROUNDING = 64 * SINGLE * 2

CASES = (
    Case(
        "exact_inverses",
        "four rotations by large angles must cancel",
        "angle, degrees",
        (0.0, 1e-6, 1.0, 45.0, 90.0, 150.0, 179.999, 180.0, 360.0),
        "zero",
        _exact_inverses,
        _ROUNDING,
        "m",
        "four rigid motions of coordinates up to 2 m, some ten roundings each",
    ),
    Case(
        "empty_selection",
        "a mean over no points divides zero by zero",
        "points",
        (0.0, 1.0, 2.0),
        "exactly zero",
        _empty,
        lambda count: _ROUNDING if count else 0.0,
        "m",
        "exact for none; rounding of four rigid motions for one and two",
    ),
    Case(
        "half_precision",
        "float16 ends at 65504: a sum over many points overflows",
        "points",
        (10.0, 1e3, 1e5, 1e6),
        "the mean of equal numbers",
        _half_precision,
        1e-3,
        "m",
        "one rounding of float16 at 0.75",
    ),
    Case(
        "turned_body",
        "150 degrees between two frames",
        "turn, degrees",
        (0.0, 90.0, 150.0, 180.0),
        "zero: every node carries the same rigid motion",
        _turned_body,
        1e-5,
        "m",
        "Procrustes and the maps of the nodes are stored in float32: some ten roundings of 1 m",
    ),
    Case(
        "fast_limb",
        "an arm that moves farther between frames than the body is wide",
        "swing, degrees",
        (0.0, 30.0, 90.0, 150.0),
        "zero",
        _fast_limb,
        0.1 * _CELL,
        "m",
        "only the joint is blended: a tenth of the points, wrong by at most the lattice's spacing",
    ),
    Case(
        "parts_in_contact",
        "the canonical frame alone cannot tell touching parts from one part",
        "gap, m",
        (0.0, 0.01, 0.05),
        "zero",
        _contact,
        0.25 * _CELL,
        "m",
        "points of a cell that both parts reach go with one of them: a quarter of the points, "
        "by a spacing at most",
    ),
    Case(
        "collapsed_region",
        "a map that is squeezed flat has no inverse",
        "thickness, share",
        (1.0, 0.1, 0.0),
        "zero",
        _collapsed,
        lambda scale: 1e-5 if scale == 1.0 else 0.5,
        "m",
        "the body is 0.3 m thick: no point can be sent farther off than it is wide; all is finite",
    ),
    Case(
        "long_chain",
        "errors of round trips grow along a chain",
        "round trips",
        (2.0, 3.0, 5.0, 10.0),
        "eps (L^k - 1) / (L - 1) with the measured eps and L",
        _chain,
        1.0,
        "of the allowed",
        "the bound of a Lipschitz map iterated k times, eps its largest single error",
        quick=False,
    ),
)
