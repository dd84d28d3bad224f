"""A skeleton found in a mesh sequence: rigid parts, the joints between them, how far they bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    dijkstra,
    minimum_spanning_tree,
)
from scipy.spatial import cKDTree

from mocoflow_core.body.rigid_controls import best_rotation

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

# How far, relative to each other, a joint's motion and the seam between its parts place its pivot:
# a residual of 2 mm against a pivot 3 cm off the seam's middle.
_PIVOT_PRIOR = (0.002 / 0.03) ** 2
# Prefers short ways among equally stiff ones, radians for each metre.
_LENGTH_PRICE = 0.02
# Rounds of giving vertices at a seam to the part that they move with.
_SEAM_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Articulation:
    """Parts in an order in which parents come first; part 0 is the root, its own parent."""

    weights: Array  # (V, P) share of each part in each vertex, rows sum to one
    parents: Labels  # (P,)
    pivots: Array  # (T, P, 3) where a part hangs on its parent, world metres
    bases: Array  # (T, P, 3, 3) how the parent is turned, from the first frame
    bend: Array  # (P,) rms angle about each axis between part and parent over the frames, radians


def articulate(
    vertices: NDArray[np.floating], faces: NDArray[np.int32], parts: int, blend_m: float
) -> Articulation:
    """Find the parts of a body that move rigidly, and the tree of joints between them.

    Neighbouring parts that never bend against each other are joined first, so that the joints of
    the tree are the body's.

    Args:
        vertices: (T, V, 3) world metres.
        faces: (F, 3).
        parts: how many parts at most.
        blend_m: how far motion is blended across a seam.

    Source: James and Twigg, Skinning Mesh Animations, 2005 (parts and seams from motion alone).
    """
    rest = np.asarray(vertices[0], np.float64)
    moving = np.asarray(vertices, np.float64)
    graph = _surface_graph(rest, faces)
    labels = _cells(graph, rest, parts)
    for _ in range(_SEAM_ROUNDS):
        rotations, shifts = _rigid_motions(rest, moving, labels)
        labels = _move_seams(graph, rest, moving, labels, rotations, shifts)
    labels = np.unique(labels, return_inverse=True)[1].reshape(-1)
    rotations, shifts = _rigid_motions(rest, moving, labels)
    bend, seams = _joints(graph, rest, labels, rotations)
    order, parents = _tree(bend, seams, _root(moving, labels))
    rank = np.argsort(order)
    parents_of = np.where(parents < 0, order[0], parents)  # by old label
    pivots = [_pivot(p, int(parents_of[p]), seams, rotations, shifts) for p in order[1:]]
    root = np.stack([frame[labels == order[0]].mean(0) for frame in moving])
    return Articulation(
        weights=_blended(graph, rest, rank[labels], blend_m),
        parents=rank[parents_of[order]],
        pivots=np.stack([root, *pivots], axis=1),
        bases=rotations[:, parents_of[order]],
        bend=np.array([0.0, *(bend[p, parents_of[p]] for p in order[1:])]),
    )


def _surface_graph(rest: Array, faces: NDArray[np.int32]) -> csr_array:
    """Symmetric edge lengths (V, V); loose pieces are tied to the nearest vertex of the largest."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    count = len(rest)
    ones = np.ones(len(pairs))
    _, piece = connected_components(coo_array((ones, pairs.T), (count, count)), directed=False)
    largest = np.flatnonzero(piece == np.bincount(piece).argmax())
    tree = cKDTree(rest[largest])
    for label in np.setdiff1d(np.unique(piece), piece[largest[:1]]):
        members = np.flatnonzero(piece == label)
        distance, near = tree.query(rest[members])
        tie = distance.argmin()
        pairs = np.concatenate([pairs, [[members[tie], largest[near[tie]]]]])
    length = np.maximum(np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=1), 1e-6)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    return csr_array((np.tile(length, 2), both.T), (count, count))


def _cells(graph: csr_array, rest: Array, parts: int) -> Labels:
    """Each vertex's nearest of some seeds far apart, along the surface."""
    seed = int(np.linalg.norm(rest - rest.mean(0), axis=1).argmin())
    distance = np.full(len(rest), np.inf)
    labels = np.zeros(len(rest), np.int64)
    for part in range(min(parts, len(rest))):
        reach = dijkstra(graph, indices=seed)
        closer = reach < distance
        labels[closer], distance[closer] = part, reach[closer]
        seed = int(distance.argmax())
    return labels


def _rigid_motions(rest: Array, moving: Array, labels: Labels) -> tuple[Array, Array]:
    """Rotation (T, P, 3, 3) and shift (T, P, 3) of each part since the first frame."""
    count = int(labels.max()) + 1
    rotations = np.empty((len(moving), count, 3, 3))
    shifts = np.empty((len(moving), count, 3))
    whole = best_rotation(
        np.broadcast_to(rest - rest.mean(0), moving.shape),
        moving - moving.mean(1, keepdims=True),
    ).astype(np.float64)
    for part in range(count):
        members = labels == part
        source, target = rest[members], moving[:, members]
        centre, moved = source.mean(0), target.mean(1)
        local = source - centre
        covariance = np.swapaxes(target - moved[:, None], 1, 2) @ local
        # Flat or tiny parts turn with the body where their own points leave it open.
        covariance += (1e-3 * (local**2).sum() + 1e-9) * whole
        rotations[:, part] = _nearest_rotation(covariance)
        shifts[:, part] = moved - rotations[:, part] @ centre
    return rotations, shifts


def _nearest_rotation(matrix: Array) -> Array:
    u, _, vt = np.linalg.svd(matrix)
    u[..., -1] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt


def _move_seams(
    graph: csr_array, rest: Array, moving: Array, labels: Labels, rotations: Array, shifts: Array
) -> Labels:
    """Give each vertex to the part, among its own and its neighbours', that it moves with."""
    residual = np.zeros((len(rest), rotations.shape[1]))
    for frame, turn, shift in zip(moving, rotations, shifts, strict=True):
        placed = np.einsum("pij,vj->vpi", turn, rest) + shift
        residual += ((placed - frame[:, None]) ** 2).sum(-1)
    start, end = graph.nonzero()
    allowed = np.zeros(residual.shape, bool)
    allowed[start, labels[end]] = True
    allowed[np.arange(len(labels)), labels] = True
    best = np.where(allowed, residual, np.inf)
    chosen = best.argmin(1)
    own = residual[np.arange(len(labels)), labels]
    gain = own - best.min(1)
    # Rounding moves no seam of a body that does not bend.
    moved = np.where(gain > len(moving) * 1e-8, chosen, labels)
    emptied = np.setdiff1d(np.unique(labels), np.unique(moved))
    return np.where(np.isin(labels, emptied), labels, moved)


def _joints(
    graph: csr_array, rest: Array, labels: Labels, rotations: Array
) -> tuple[Array, dict[tuple[int, int], Array]]:
    """Bend (P, P) of touching parts in radians for each axis, infinite elsewhere; seam centres."""
    start, end = graph.nonzero()
    across = labels[start] < labels[end]
    middles = 0.5 * (rest[start] + rest[end])[across]
    pairs = np.stack([labels[start], labels[end]], -1)[across]
    count = rotations.shape[1]
    bend = np.full((count, count), np.inf)
    seams: dict[tuple[int, int], Array] = {}
    for a, b in np.unique(pairs, axis=0):
        relative = np.swapaxes(rotations[:, a], -1, -2) @ rotations[:, b]
        usual = _nearest_rotation(relative.mean(0))
        cosine = (np.einsum("tij,ij->t", relative, usual) - 1.0) / 2.0
        angle = np.arccos(cosine.clip(-1.0, 1.0))
        bend[a, b] = bend[b, a] = np.sqrt((angle**2).mean() / 3.0)
        seams[a, b] = seams[b, a] = middles[(pairs == (a, b)).all(1)].mean(0)
    return bend, seams


def _root(moving: Array, labels: Labels) -> int:
    """The part nearest to the middle of the body."""
    middle = moving.mean(1)
    parts = range(int(labels.max()) + 1)
    centres = [moving[:, labels == part].mean(1) for part in parts]
    return int(np.argmin([np.linalg.norm(centre - middle, axis=1).mean() for centre in centres]))


def _tree(bend: Array, seams: dict[tuple[int, int], Array], root: int) -> tuple[Labels, Labels]:
    """Parts from the root outwards and the parent of each, over the stiffest connections."""
    # A zero is no edge to the sparse graph, so that every connection costs a little.
    cost = np.where(np.isfinite(bend), bend + 1e-4 * _LENGTH_PRICE, 0.0)
    tree = minimum_spanning_tree(coo_array(cost).tocsr())
    order, parents = breadth_first_order(tree, root, directed=False)
    return order.astype(np.int64), parents.astype(np.int64)


def _pivot(
    part: int,
    parent: int,
    seams: dict[tuple[int, int], Array],
    rotations: Array,
    shifts: Array,
) -> Array:
    """Where (T, 3) both parts agree in every frame, near their seam where the motion is silent."""
    seam = seams[part, parent]
    turn = rotations[:, part] - rotations[:, parent]
    gap = shifts[:, part] - shifts[:, parent]
    system = np.einsum("tji,tjk->ik", turn, turn) / len(turn) + _PIVOT_PRIOR * np.eye(3)
    wanted = _PIVOT_PRIOR * seam - np.einsum("tji,tj->i", turn, gap) / len(turn)
    point = np.linalg.solve(system, wanted)
    placed = [rotations[:, p] @ point + shifts[:, p] for p in (part, parent)]
    return 0.5 * (placed[0] + placed[1])


def _blended(graph: csr_array, rest: Array, labels: Labels, blend_m: float) -> Array:
    """Weights (V, P): labels diffused along the surface, which never jumps between limbs."""
    weights = np.eye(int(labels.max()) + 1)[labels]
    rounds = max(1, round((blend_m / float(np.median(graph.data))) ** 2))
    connected = csr_array((np.ones(graph.nnz), graph.indices, graph.indptr), graph.shape)
    degree = np.asarray(connected.sum(axis=1)).reshape(-1, 1)
    for _ in range(rounds):
        weights = 0.5 * weights + 0.5 * (connected @ weights) / np.maximum(degree, 1)
    return weights
