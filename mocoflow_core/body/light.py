"""The direction that light comes from, measured on a body that turns in it.

A point of the skin gets brighter as it turns towards the light. Where it is followed over many
frames by the mesh, its own colour cancels and the light remains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.body.vertex_normals import vertex_normals
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart

Floats = NDArray[np.float64]

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
_DARKEST = 2e-3  # linear light below this is noise of the encoding
_ITERATIONS = 10


class LightConfig(ConfigurationPart):
    """How the light is measured."""

    least_facing: float = Field(
        0.4, ge=0, lt=1, description="cosine to the camera; pixels at flatter sights are left out"
    )
    ridge: float = Field(
        0.002, ge=0, description="pull to no direction, in variances of the normals: still bodies"
    )
    largest: float = Field(0.9, gt=0, lt=1, description="longest light vector; 1 is full darkness")


def measure_light(clip: Clip, meshes: MeshSequence, configuration: LightConfig) -> Floats:
    """The light as a vector b: linear brightness is the colour's times ``1 + b . normal``.

    Args:
        clip: the train camera's; held-out frames are not looked at.
        meshes: at least the clip's frames, world metres.

    Returns:
        (3,) in world space; zero where nothing can be told. Its length is at most
        ``configuration.largest``, so that no surface gets negative light.
    """
    rows = np.flatnonzero(~clip.held_out & clip.has_mask)
    posed = meshes.at(clip.frame_indices[rows]).vertices.astype(np.float64)
    tracks = [
        _seen_patches(clip, row, vertices, meshes.faces, configuration.least_facing)
        for row, vertices in zip(rows.tolist(), posed, strict=True)
    ]
    if not any(len(seen) for seen, _, _ in tracks):
        return np.zeros(3)
    vertex = np.concatenate([track[0] for track in tracks])
    normal = np.concatenate([track[1] for track in tracks])
    brightness = np.concatenate([track[2] for track in tracks])
    return _fit(vertex, normal, np.log(brightness), configuration)


def _seen_patches(
    clip: Clip, row: int, vertices: Floats, faces: NDArray[np.int32], least_facing: float
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Vertices seen in one frame with the mean normal and linear brightness of their pixels."""
    raster = rasterise(vertices, faces, clip.camera)
    normals = interpolate(raster, faces, vertex_normals(vertices, faces))
    sight = interpolate(raster, faces, vertices - clip.camera.centre_world)
    length = np.linalg.norm(normals, axis=-1) * np.linalg.norm(sight, axis=-1)
    facing = -(normals * sight).sum(-1) / np.maximum(length, 1e-12)
    seen = raster.covered & clip.masks[row] & (facing > least_facing)
    corner = raster.barycentric[seen].argmax(-1)
    vertex = faces[raster.face_index[seen], corner]
    light = linear_light(clip.frames[row][seen]) @ _LUMINANCE
    found, place = np.unique(vertex, return_inverse=True)
    count = np.bincount(place)
    total = np.zeros((len(found), 3))
    np.add.at(total, place, normals[seen])
    mean_normal = total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-12)
    brightness = np.bincount(place, light) / count
    return found.astype(np.int64), mean_normal, np.maximum(brightness, _DARKEST)


def _fit(
    vertex: NDArray[np.int64], normal: Floats, brightness: Floats, configuration: LightConfig
) -> Floats:
    """Robust Gauss-Newton on ``log brightness = colour of the vertex + log(1 + b . normal)``."""
    light = np.zeros(3)
    _, vertex = np.unique(vertex, return_inverse=True)
    for _ in range(_ITERATIONS):
        shade = 1.0 + normal @ light
        slope = normal / shade[:, None]
        residual = brightness - np.log(shade)
        weight = np.ones(len(vertex))
        for _ in range(3):
            residual_now = _without_means(residual, vertex, weight)
            scale = 1.4826 * np.median(np.abs(residual_now)) + 1e-6
            weight = 1.0 / np.maximum(np.abs(residual_now) / scale, 1.0)
        slope = _without_means(slope, vertex, weight)
        normal_equations = slope.T @ (weight[:, None] * slope)
        pull = configuration.ridge * weight.sum() / 3.0
        normal_equations += pull * np.eye(3)
        pulled = slope.T @ (weight * residual_now) - pull * light
        light = light + np.linalg.solve(normal_equations, pulled)
        light *= min(1.0, configuration.largest / max(float(np.linalg.norm(light)), 1e-12))
    return light


def _without_means(values: Floats, group: NDArray[np.int64], weight: Floats) -> Floats:
    """Values (N, ...) less the weighted mean of their group."""
    total = np.bincount(group, weight)
    flat = values.reshape(len(values), -1)
    means = np.stack([np.bincount(group, weight * column) / total for column in flat.T], -1)
    return (flat - means[group]).reshape(values.shape)


def linear_light(encoded: NDArray[np.uint8]) -> Floats:
    """sRGB bytes (...) to linear light in [0, 1]."""
    value = encoded / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
