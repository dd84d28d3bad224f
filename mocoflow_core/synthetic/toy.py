"""A tiny scene in less than a second: a figure of five capsules that turns and waves.

It needs no body model. Its surface is one connected closed mesh (the level set of smoothly joined
capsules), skinned like a body's, so everything that works on a person works on it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation
from skimage.measure import marching_cubes

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.progress import Progress
from mocoflow_core.synthetic.configuration import RecordingConfig
from mocoflow_core.synthetic.recording import Performance, record_scene
from mocoflow_core.synthetic.scene_files import SceneFiles
from mocoflow_core.synthetic.surface import Surface
from mocoflow_core.synthetic.texture import Array, checker, linear, stripes

Points = NDArray[np.float64]

# Capsules: joint, far end, radius; metres, root at the origin, looking at -y.
_TORSO, _LEFT_ARM, _RIGHT_ARM, _LEFT_LEG, _RIGHT_LEG = range(5)
_CAPSULES = (
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.68), 0.15),
    ((0.16, 0.0, 0.42), (0.60, 0.0, 0.12), 0.07),
    ((-0.16, 0.0, 0.42), (-0.60, 0.0, 0.12), 0.07),
    ((0.10, 0.0, -0.05), (0.17, 0.0, -0.75), 0.09),
    ((-0.10, 0.0, -0.05), (-0.17, 0.0, -0.75), 0.09),
)
_CELL = 0.045  # Of the grid that the surface is extracted from, metres.
_JOINED = 0.03  # Width of the smooth joints between capsules, metres.
_COLOURS = ("#d8a13c", "#b3122e", "#0f7a78", "#35507e", "#6b3a7a")

# COCO-17: capsule and place along it, sideways offset from its axis.
_KEYPOINTS = (
    *((0, 0.95, 0.0), (0, 1.0, 0.04), (0, 1.0, -0.04), (0, 0.97, 0.1), (0, 0.97, -0.1)),
    *((1, 0.0, 0.0), (2, 0.0, 0.0), (1, 0.5, 0.0), (2, 0.5, 0.0), (1, 1.0, 0.0), (2, 1.0, 0.0)),
    *((3, 0.0, 0.0), (4, 0.0, 0.0), (3, 0.5, 0.0), (4, 0.5, 0.0), (3, 1.0, 0.0), (4, 1.0, 0.0)),
)
_VERTICES_PER_KEYPOINT = 12

_ATTRIBUTION = "Rendered from five capsules."


class ToyConfig(RecordingConfig):
    """A recording small enough for tests."""

    name: str = Field("toy", pattern=r"^[^/]+$", description="Name of the scene.")
    frames: int = Field(8, ge=1, description="Number of frames.")
    width: int = Field(32, ge=8, description="Pixels of every camera.")
    height: int = Field(32, ge=8, description="Pixels of every camera.")
    cameras: int = Field(3, ge=1, description="Cameras on the ring; cam00 is trained on.")
    supersampling: int = Field(2, ge=1, le=8, description="Rays per pixel along each axis.")
    turn_deg: float = Field(90.0, description="How far the figure turns over the clip.")
    wave_deg: float = Field(25.0, description="How far arms and legs swing to each side.")


def write_toy_scene(
    folder: Path, configuration: ToyConfig | None = None, progress: Progress | None = None
) -> None:
    """Write the toy scene; its meshes are exact. Raises InputError if the folder holds anything."""
    configuration = configuration or ToyConfig()
    files = SceneFiles(folder)
    rest, faces = _rest_mesh()
    vertices, root = _posed(rest, configuration)
    regressor = _keypoint_regressor(rest)
    parts = _distances(rest[faces].mean(axis=1)).argmin(axis=1).astype(np.int8)
    surface = Surface(rest.astype(np.float32), faces, parts, _albedo)
    meshes = MeshSequence(
        np.arange(configuration.frames, dtype=np.int32),
        vertices.astype(np.float32),
        faces,
        regressor.astype(np.float32),
    )
    keypoints = np.einsum("kv,tvd->tkd", regressor, vertices)
    performance = Performance(surface, vertices, keypoints, root)
    record_scene(performance, meshes, configuration, files, _ATTRIBUTION, progress)


def _distances(points: Points) -> NDArray[np.float64]:
    """Signed distance (N, 5) of points (N, 3) to each capsule."""
    distances = np.empty((len(points), len(_CAPSULES)))
    for index, (start, end, radius) in enumerate(_CAPSULES):
        axis = np.subtract(end, start)
        along = ((points - start) @ axis / (axis @ axis)).clip(0, 1)
        distances[:, index] = (
            np.linalg.norm(points - start - along[:, None] * axis, axis=1) - radius
        )
    return distances


def _rest_mesh() -> tuple[Points, NDArray[np.int32]]:
    """Vertices (V, 3) and outward triangles (F, 3) of the joined capsules."""
    low, high = np.array([-0.8, -0.3, -1.0]), np.array([0.8, 0.3, 1.0])
    shape = np.ceil((high - low) / _CELL).astype(int)
    grid = low + _CELL * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    distances = _distances(grid.reshape(-1, 3))
    joined = -_JOINED * np.log(np.exp(-distances / _JOINED).sum(axis=1))
    vertices, faces, _, _ = marching_cubes(joined.reshape(shape), 0.0, spacing=(_CELL,) * 3)
    return low + vertices, faces.astype(np.int32)


def _skinning(rest: Points) -> NDArray[np.float64]:
    """(V, 5) smooth weights of the capsules, rows sum to one."""
    weights = np.exp(-_distances(rest) / _JOINED)
    return weights / weights.sum(axis=1, keepdims=True)


def _posed(rest: Points, configuration: ToyConfig) -> tuple[Points, Points]:
    """World vertices (T, V, 3), root (T, 3): the figure turns, limbs swing about their joints."""
    times = np.linspace(0, 1, configuration.frames)
    swing = configuration.wave_deg * np.sin(2 * np.pi * times)
    axes = {_LEFT_ARM: ("y", 1), _RIGHT_ARM: ("y", 1), _LEFT_LEG: ("x", 1), _RIGHT_LEG: ("x", -0.6)}
    weights = _skinning(rest)
    vertices = weights[None, :, _TORSO, None] * rest
    for limb, (axis, share) in axes.items():
        joint = np.array(_CAPSULES[limb][0])
        matrices = Rotation.from_euler(axis, share * swing[:, None], degrees=True).as_matrix()
        moved = np.einsum("tij,vj->tvi", matrices, rest - joint) + joint
        vertices = vertices + weights[None, :, limb, None] * moved
    headings = configuration.turn_deg * times[:, None]
    turned = np.einsum(
        "tij,tvj->tvi", Rotation.from_euler("z", headings, degrees=True).as_matrix(), vertices
    )
    root = np.zeros((len(times), 3))
    root[:, 2] = -turned[..., 2].min(axis=1)
    return turned + root[:, None], root


def _keypoint_regressor(rest: Points) -> NDArray[np.float64]:
    """(17, V) each keypoint the mean of the vertices nearest to its place."""
    regressor = np.zeros((len(_KEYPOINTS), len(rest)))
    for row, (capsule, along, sideways) in enumerate(_KEYPOINTS):
        start, end, _ = _CAPSULES[capsule]
        forward = 0.1 if row < 3 else 0.0  # Nose and eyes lie in front.
        place = start + along * np.subtract(end, start) + np.array([sideways, -forward, 0.0])
        nearest = np.linalg.norm(rest - place, axis=1).argsort()[:_VERTICES_PER_KEYPOINT]
        regressor[row, nearest] = 1 / _VERTICES_PER_KEYPOINT
    return regressor


def _albedo(points: Array, parts: NDArray[np.int8]) -> Array:
    """A colour for each capsule, striped along z, a checker on the chest, a dark back."""
    colours = np.stack([linear(colour) for colour in _COLOURS])[parts]
    colours = np.where(stripes(points[:, 2], 0.16)[:, None], colours, 0.45 * colours + 0.4)
    chest = (parts == _TORSO) & (points[:, 1] < -0.02)
    colours[chest & checker(points[:, 0], points[:, 2], 0.1)] = linear("#f4f4f0")
    back = (parts == _TORSO) & (points[:, 1] > 0.05)
    colours[back] *= 0.4
    return colours.astype(np.float32)
