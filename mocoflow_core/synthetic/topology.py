"""The same surface with other vertices: each one a fixed mixture of three of the body's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from trimesh.triangles import closest_point, points_to_barycentric

from mocoflow_core.synthetic.anny_model import read_topology
from mocoflow_core.synthetic.person import Person

_CANDIDATES = 24  # Triangles tried per vertex; the nearest centroid alone may miss the nearest one.


@dataclass(frozen=True, eq=False)
class Topology:
    """Vertices that stay on the body's surface in every pose, and their triangles."""

    mixture: csr_array  # (V', V) rows sum to one
    faces: NDArray[np.int32]  # (F', 3)
    keypoint_regressor: NDArray[np.float32]  # (17, V') rows sum to one

    def vertices(self, body: NDArray[np.float64]) -> NDArray[np.float64]:
        """The vertices (T, V', 3) of posed bodies (T, V, 3)."""
        return np.stack([self.mixture @ posed for posed in body])


def body_topology(person: Person) -> Topology:
    """The body's own vertices, without those inside its cavities."""
    used = np.unique(person.outer_faces)
    number = np.full(len(person.rest_vertices), -1)
    number[used] = np.arange(len(used))
    ones = np.ones(len(used))
    mixture = csr_array((ones, (np.arange(len(used)), used)), shape=(len(used), len(number)))
    regressor = person.keypoint_regressor[:, used]
    regressor = regressor / regressor.sum(axis=1, keepdims=True)
    return Topology(
        mixture, number[person.outer_faces].astype(np.int32), regressor.astype(np.float32)
    )


def coarse_topology(person: Person, name: str) -> Topology:
    """One of Anny's own coarser meshes, projected onto the body; keypoints through the projection.

    ``notoes_collapse10pc`` has 1229 vertices, ``notoes_collapse3pc`` 369.
    """
    coarse_vertices, coarse_faces = read_topology(name)
    template = person.anny.template_vertices.numpy()
    mixture = _project(coarse_vertices, template, person.outer_faces)
    back = _project(template, mixture @ template, coarse_faces)
    regressor = person.keypoint_regressor @ back.toarray()
    return Topology(mixture, coarse_faces.astype(np.int32), regressor.astype(np.float32))


def _project(
    points: NDArray[np.float64], vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> csr_array:
    """(N, V) weights of the closest surface points to points (N, 3)."""
    triangles = vertices[faces]
    _, near = cKDTree(triangles.mean(axis=1)).query(points, k=_CANDIDATES)
    repeated = np.repeat(points, _CANDIDATES, axis=0)
    closest = closest_point(triangles[near.ravel()], repeated)
    distance = np.linalg.norm(closest - repeated, axis=1).reshape(near.shape)
    rows = np.arange(len(points))
    best = distance.argmin(axis=1)
    chosen = near[rows, best]
    closest = closest.reshape(*near.shape, 3)[rows, best]
    weights = points_to_barycentric(triangles[chosen], closest)
    weights = weights.clip(0, 1) / weights.clip(0, 1).sum(axis=1, keepdims=True)
    shape = (len(points), len(vertices))
    return csr_array((weights.ravel(), (np.repeat(rows, 3), faces[chosen].ravel())), shape=shape)
