"""Where the body is, from masks that are cut, empty, shared, tiny or say nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.located_meshes import LocatedMeshes
from mocoflow_core.body.location import locate_body
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.stability.case import Case, Found, largest, require
from mocoflow_core.stability.figures import swung, torso_and_arm

FRAMES = 5
SIDE_PX = 128
DISTANCE_M = 4.0
HEIGHT_M = 0.8
FILLED = 0.45  # of the image's height, by the body

Masks = NDArray[np.bool_]


@cache
def _walk(distance_m: float) -> NDArray[np.float64]:
    """Bodies (T, V, 3) in the camera's axes, walking past it."""
    rest, _ = torso_and_arm()
    bodies = []
    for share in np.linspace(-1, 1, FRAMES):
        body = swung(rest, 30 * share).astype(np.float64)
        # The torso stands along z; the camera's y points down and its z away.
        bodies.append(body[:, [0, 2, 1]] * [1.0, -1.0, 1.0] + [0.1 * share, 0.0, distance_m])
    return np.stack(bodies)


def _camera(distance_m: float, side_px: int = SIDE_PX) -> Camera:
    focal = FILLED * side_px * distance_m / HEIGHT_M
    K = np.array([[focal, 0, side_px / 2], [0, focal, side_px / 2], [0, 0, 1.0]])
    return Camera("cam", side_px, side_px, K, np.eye(3), np.zeros(3))


def _clip(camera: Camera, masks: Masks) -> Clip:
    count = len(masks)
    return Clip(
        camera,
        12.0,
        np.arange(count, dtype=np.int32),
        np.zeros((*masks.shape, 3), np.uint8),
        masks,
        np.ones(count, bool),
        np.zeros(count, bool),
        np.zeros((*masks.shape[1:], 3), np.uint8),
    )


def _meshes(bodies: NDArray[np.float64]) -> MeshSequence:
    _, faces = torso_and_arm()
    return MeshSequence(np.arange(len(bodies), dtype=np.int32), bodies.astype(np.float32), faces)


def _masks_of(camera: Camera, bodies: NDArray[np.float64]) -> Masks:
    return silhouettes(bodies, torso_and_arm()[1], camera)


def _located(camera: Camera, masks: Masks, bodies: NDArray[np.float64]) -> LocatedMeshes:
    """The bodies without their location, searched against the masks."""
    centred = _meshes(bodies - bodies.mean(axis=1, keepdims=True))
    ingested = IngestedMeshes(centred, "camera-root-centred", False)
    return locate_body(_clip(camera, masks), ingested, LocationConfig())


def _error(located: LocatedMeshes, bodies: NDArray[np.float64]) -> float:
    """Largest distance of a body's middle from its true place, as a share of its distance."""
    off = np.linalg.norm((located.meshes.vertices - bodies).mean(axis=1), axis=-1)
    return float((off / bodies[..., 2].mean(axis=1)).max())


def _found(located: LocatedMeshes, bodies: NDArray[np.float64]) -> Found:
    words = "; ".join(located.warnings)
    return Found(_error(located, bodies), (located.translations, located.confidence), words)


def _cut(share: float) -> Found:
    """The lower part of the body lies below the image."""
    camera, bodies = _camera(DISTANCE_M), _walk(DISTANCE_M)
    K = camera.K.copy()
    K[1, 2] += (0.5 * (1 - FILLED) + FILLED * share) * SIDE_PX
    camera = replace(camera, K=K)
    located = _located(camera, _masks_of(camera, bodies), bodies)
    require(share == 0 or bool(located.warnings), "cut masks go unnoticed")
    return _found(located, bodies)


def _empty(count: float) -> Found:
    camera, bodies = _camera(DISTANCE_M), _walk(DISTANCE_M)
    masks = _masks_of(camera, bodies)
    masks[1 : 1 + int(count)] = False
    if count == FRAMES:
        masks[:] = False
    try:
        located = _located(camera, masks, bodies)
    except InputError as error:
        require(count == FRAMES, f"refused with masks left: {error}")
        return Found(0.0, remark=str(error))
    return _found(located, bodies)


def _two_persons(apart_m: float) -> Found:
    """A second body in all masks: the search finds either, or says that it found neither."""
    camera, bodies = _camera(DISTANCE_M), _walk(DISTANCE_M)
    other = bodies + np.array([apart_m, 0.0, 0.0])
    masks = _masks_of(camera, bodies) | _masks_of(camera, other)
    located = _located(camera, masks, bodies)
    found = _found(located, bodies)
    either = min(found.error, _error(located, other))
    if located.warnings:
        return Found(0.0, found.watched, found.remark)
    return Found(either, found.watched, found.remark)


def _distance(distance_m: float) -> Found:
    """The first guess comes from the mask's size alone: no grid has an end."""
    camera, bodies = _camera(distance_m), _walk(distance_m)
    return _found(_located(camera, _masks_of(camera, bodies), bodies), bodies)


def _given_wrong(factor: float) -> Found:
    """A location is given, but so many times too far: the start lies outside the first grid."""
    camera, bodies = _camera(DISTANCE_M), _walk(DISTANCE_M)
    wrong = bodies + (factor - 1.0) * bodies.mean(axis=1, keepdims=True)
    ingested = IngestedMeshes(_meshes(wrong), "world", False)
    located = locate_body(_clip(camera, _masks_of(camera, bodies)), ingested, LocationConfig())
    return _found(located, bodies)


def _flat(side_px: float) -> Found:
    """A person of a few pixels: every place nearby gives the same mask."""
    camera, bodies = _camera(DISTANCE_M, int(side_px)), _walk(DISTANCE_M)
    located = _located(camera, _masks_of(camera, bodies), bodies)
    require(largest(located.translations) < 10 * DISTANCE_M, "a body far from everything")
    return _found(located, bodies)


def _pixels(pixels: float, height_px: float) -> float:
    """Relative error of a distance read off a body whose height is wrong by so many pixels."""
    return pixels / height_px


_HEIGHT_PX = FILLED * SIDE_PX

CASES = (
    Case(
        "cut_by_the_border",
        "the height, which tells the distance, is cut off",
        "share cut off",
        (0.0, 0.1, 0.3, 0.5),
        "true place, relative to the distance",
        _cut,
        lambda share: _pixels(1.0, _HEIGHT_PX * (1 - share)),
        "relative",
        "a pixel of what is left of the height",
    ),
    Case(
        "empty_masks",
        "frames that say nothing",
        "empty of 5",
        (0.0, 1.0, 3.0, 5.0),
        "true place, relative to the distance; refused when all are empty",
        _empty,
        _pixels(1.0, _HEIGHT_PX),
        "relative",
        "a pixel of the height; between seen frames the path is as smooth as the walk",
    ),
    Case(
        "two_persons",
        "two bodies explain half of the mask each",
        "apart, m",
        (0.0, 0.3, 0.6, 1.0),
        "the place of either, relative to the distance, or a warning",
        _two_persons,
        _pixels(2.0, _HEIGHT_PX),
        "relative",
        "two pixels of the height; a poor overlap must be reported",
        quick=False,
    ),
    Case(
        "distance",
        "a target far outside any grid that one would choose",
        "distance, m",
        (0.8, 2.0, 10.0, 50.0),
        "true place, relative to the distance",
        _distance,
        _pixels(1.0, _HEIGHT_PX),
        "relative",
        "a pixel of the height, which is the same at every distance here",
    ),
    Case(
        "start_outside_the_grid",
        "a given location that is far off",
        "times too far",
        (0.3, 0.7, 1.0, 1.5, 4.0),
        "true place, relative to the distance",
        _given_wrong,
        _pixels(1.0, _HEIGHT_PX),
        "relative",
        "a pixel of the height: levels repeat until the best depth lies inside",
        quick=False,
    ),
    Case(
        "flat_objective",
        "a person of a few pixels",
        "image side, px",
        (4.0, 8.0, 16.0, 32.0, 128.0),
        "true place, relative to the distance",
        _flat,
        lambda side: _pixels(1.0, FILLED * side),
        "relative",
        "a pixel of the height, which is two pixels in the smallest image",
        quick=False,
    ),
)
