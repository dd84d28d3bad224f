"""The frame whose body serves as the canonical one: limbs apart, nothing touching."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from mocoflow_core.body.mesh_sequence import MeshSequence

# So many vertices, spread over the mesh, tell a pose; all of them cost without telling more.
SAMPLED_VERTICES = 256
# Along the surface, points of one limb's cross-section are nearer than this, other parts farther.
FAR_ON_SURFACE_M = 0.4
# In space, parts nearer than about this are in contact and would mix.
CONTACT_M = 0.08


def closeness(meshes: MeshSequence) -> NDArray[np.float64]:
    """How close parts that are far apart on the surface come in space, (T,); 0 is fully spread.

    Mean of exp(-distance / CONTACT_M) over pairs of sampled vertices.
    """
    count = meshes.vertices.shape[1]
    sample = np.unique(np.linspace(0, count - 1, SAMPLED_VERTICES).astype(int))
    surface = _surface_distances(meshes, sample)
    first, second = np.nonzero(np.triu(surface > FAR_ON_SURFACE_M, 1))
    if not len(first):
        return np.zeros(len(meshes.vertices))
    points = meshes.vertices[:, sample].astype(np.float64)
    return np.array(
        [np.exp(-_distances(body[first], body[second]) / CONTACT_M).mean() for body in points]
    )


def _surface_distances(meshes: MeshSequence, sample: NDArray[np.intp]) -> NDArray[np.float64]:
    """Shortest ways along edges between sampled vertices, metres, of the first frame's body."""
    faces = meshes.faces
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    start, end = np.unique(edges, axis=0).T
    body = meshes.vertices[0].astype(np.float64)
    lengths = _distances(body[start], body[end])
    count = len(body)
    graph = coo_array((lengths, (start, end)), shape=(count, count)).tocsr()
    return dijkstra(graph, directed=False, indices=sample)[:, sample]


def _distances(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(first - second, axis=-1)
