"""The surface of a made person in SMPL's rest pose and axes: capsules that melt into each other.

Metres; y up, x to the person's left, facing +z, the pelvis 0.22 m below the origin.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from skimage.measure import marching_cubes

# The left side of the skeleton in metres; the right side is its mirror image.
_MIDDLE = {
    "pelvis": (0, -0.22, 0.02),
    "spine1": (0, -0.11, 0.01),
    "spine2": (0, 0.02, 0.02),
    "spine3": (0, 0.08, 0.02),
    "neck": (0, 0.29, 0.0),
    "head": (0, 0.37, 0.03),
}
_LEFT = {
    "hip": (0.08, -0.31, 0.01),
    "knee": (0.11, -0.69, 0.01),
    "ankle": (0.12, -1.08, -0.02),
    "foot": (0.13, -1.13, 0.10),
    "collar": (0.08, 0.20, 0.0),
    "shoulder": (0.18, 0.23, -0.01),
    "elbow": (0.44, 0.22, -0.03),
    "wrist": (0.69, 0.22, -0.03),
    "hand": (0.78, 0.22, -0.03),
}
# Bones that carry flesh, by the joint that moves them: two ends, their radii.
_BONES = {
    "pelvis": ("pelvis", "spine1", 0.13),
    "spine1": ("spine1", "spine2", 0.125),
    "spine2": ("spine2", "spine3", 0.13),
    "spine3": ("spine3", "neck", 0.10),
    "neck": ("neck", "head", 0.055),
    "head": ("head", "crown", 0.095),
    "l_hip": ("l_hip", "l_knee", 0.078),
    "l_knee": ("l_knee", "l_ankle", 0.052),
    "l_ankle": ("l_ankle", "l_foot", 0.045),
    "l_foot": ("l_foot", "l_toes", 0.038),
    "l_collar": ("l_collar", "l_shoulder", 0.07),
    "l_shoulder": ("l_shoulder", "l_elbow", 0.050),
    "l_elbow": ("l_elbow", "l_wrist", 0.042),
    "l_wrist": ("l_wrist", "l_hand", 0.042),
    "l_hand": ("l_hand", "l_tips", 0.038),
}
_ENDS = {"crown": (0, 0.46, 0.03), "l_toes": (0.13, -1.14, 0.15), "l_tips": (0.85, 0.22, -0.03)}
_BLEND_M = 0.02  # over which neighbouring parts melt into each other
_REACH_M = 0.2  # beyond which they do not


@cache
def surface(vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """One closed surface with exactly so many vertices: cut from a grid, then edges split.

    With fewer than about 600 the grid is too coarse for arms and the body falls apart.
    """
    step = np.sqrt(3.0 / vertices)
    while True:
        points, faces = _cut(step)
        if len(points) <= vertices:
            return _split_edges(points, faces, vertices)
        step *= 1.02


def _cut(step: float) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.array([-1.0, -1.3, -0.3]), np.array([1.0, 0.7, 0.35])
    axes = [np.arange(a, b, step) for a, b in zip(low, high, strict=True)]
    points, faces, _, _ = marching_cubes(_distance(axes), 0.0, spacing=(step,) * 3)
    points, faces = points.astype(float) + low, faces.astype(np.int64)
    corners = points[faces]
    volume = np.einsum("fi,fi->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2])
    return points, faces if volume > 0 else faces[:, ::-1]


def _distance(axes: list[np.ndarray]) -> np.ndarray:
    """Smooth union of the parts on a grid, negative inside; each part counts where it is near."""
    names = [*_BONES, *(f"r_{name[2:]}" for name in _BONES if name.startswith("l_"))]
    total = np.full([len(axis) for axis in axes], np.exp(-_REACH_M / _BLEND_M))
    for name in names:
        left = f"l_{name[2:]}" if name.startswith("r_") else name
        start, end, radius = _BONES[left]
        ends = [f"r_{e[2:]}" if name.startswith("r_") else e for e in (start, end)]
        start, end = place(ends[0]), place(ends[1])
        reach = radius + _REACH_M
        window = tuple(
            slice(*np.searchsorted(axis, [min(a, b) - reach, max(a, b) + reach]))
            for axis, a, b in zip(axes, start, end, strict=True)
        )
        near = [axis[part] for axis, part in zip(axes, window, strict=True)]
        points = np.stack(np.meshgrid(*near, indexing="ij"), axis=-1)
        total[window] += np.exp((radius - to_segment(points, start, end)) / _BLEND_M)
    return -_BLEND_M * np.log(total)


def to_segment(points, start, end) -> np.ndarray:
    along = end - start
    share = np.clip((points - start) @ along / max(along @ along, 1e-12), 0, 1)
    return np.linalg.norm(points - (start + share[..., None] * along), axis=-1)


def _split_edges(points, faces, vertices) -> tuple[np.ndarray, np.ndarray]:
    """Splits the longest edges, two triangles at a time, until the count is reached."""
    points, faces = [*points], [tuple(map(int, face)) for face in faces]
    while len(points) < vertices:
        edges = {}
        for number, face in enumerate(faces):
            for a, b in zip(face, (*face[1:], face[0]), strict=True):
                edges.setdefault((min(a, b), max(a, b)), []).append(number)
        lengths = {e: np.linalg.norm(points[e[0]] - points[e[1]]) for e in edges}
        used: set[int] = set()
        for edge in sorted(edges, key=lambda e: (-lengths[e], e)):
            if len(points) == vertices or used & set(edges[edge]):
                continue
            used |= set(edges[edge])
            points.append((points[edge[0]] + points[edge[1]]) / 2)
            for number in edges[edge]:
                face, middle = faces[number], len(points) - 1
                faces[number] = tuple(middle if v == edge[0] else v for v in face)
                faces.append(tuple(middle if v == edge[1] else v for v in face))
    return np.array(points), np.array(faces)


def place(name: str) -> np.ndarray:
    if name.startswith("r_"):
        return place(f"l_{name[2:]}") * (-1, 1, 1)
    places = _MIDDLE | _ENDS | {f"l_{part}": place for part, place in _LEFT.items()}
    return np.array(places[name], float)
