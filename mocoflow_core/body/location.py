"""Where the body is: the translation of a mesh estimate without one, found from the masks.

MoCo-Flow sec. 3.1: the mesh's silhouette against the mask, a 3-D grid, coarse to fine, smooth in
time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.agreement import is_cut
from mocoflow_core.body.grid_search import Placement, first_guess, search_grid
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.located_meshes import LocatedMeshes
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.location_trust import (
    crop_overlap,
    grid_crop,
    location_warnings,
    placement_confidence,
    unexplained,
)
from mocoflow_core.body.mask_crop import MaskCrop, facing
from mocoflow_core.body.outline_fit import fit_outline
from mocoflow_core.body.robust_path import robust_path
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError

Array = NDArray[np.float64]
# Where no frame can be trusted at all, all count alike.
EVEN_CONFIDENCE = 0.01


def locate_body(
    clip: Clip,
    ingested: IngestedMeshes,
    configuration: LocationConfig,
    progress: Callable[[float, str], None] = lambda fraction, text: None,
) -> LocatedMeshes:
    """Find the body's translation in each frame from the train camera's masks.

    Root-centred meshes are searched from the mask's size and from their first translations, others
    from where they are given. Frames whose place disagrees with those around them, whatever their
    mask shows, lose their say. Held-out frames, frames without a mask and frames between those of
    the clip are interpolated. Bodies that came with a location keep it where the found one does
    not explain the masks far better: their joints are wrong then, and a place that was fitted to
    wrong joints is the worse one.

    Raises InputError when no mask shows the person.
    """
    posed = _in_camera(clip, ingested)
    searched = np.flatnonzero(~clip.held_out & clip.masks.any(axis=(1, 2)))
    if not len(searched):
        raise InputError("a mask that shows the person", "empty masks only", "Check the masks.")
    numbers = ingested.meshes.frame_indices
    rows = np.searchsorted(numbers, clip.frame_indices[searched])
    centres = posed.mean(axis=1)
    found = np.full((len(posed), 3), np.nan)
    residual = np.full(len(posed), np.nan)
    confidence = np.zeros(len(posed))
    for done, (position, row) in enumerate(zip(searched.tolist(), rows.tolist(), strict=True)):
        starts = _starts(ingested, row)
        placement = _place(clip, position, posed[row], ingested.meshes.faces, starts, configuration)
        found[row] = centres[row] + placement.translation
        residual[row] = 1 - placement.overlap
        confidence[row] = placement_confidence(clip, posed[row], placement, configuration)
        progress((done + 1) / len(searched), f"located frame {numbers[row]}")
    if not confidence.any():
        confidence[rows] = EVEN_CONFIDENCE
    path, kept = _smooth(clip, numbers, found, confidence, configuration)
    confidence = confidence * kept
    translations = path - centres

    crops = [grid_crop(clip.masks[position], clip, configuration) for position in searched]
    faces = ingested.meshes.faces
    reached = unexplained(crops, posed[rows] + translations[rows, None], faces)
    given = unexplained(crops, posed[rows], faces) if ingested.located else math.inf
    adopted = configuration.least_gain == 0 or reached < (1 - configuration.least_gain) * given
    if not adopted:
        translations = np.zeros_like(translations)
    world = clip.camera.to_world(posed + translations[:, None])
    cut = numbers[rows[[is_cut(clip.masks[position]) for position in searched]]]
    return LocatedMeshes(
        replace(ingested.meshes, vertices=world.astype(np.float32)),
        translations,
        residual,
        confidence,
        reached,
        given,
        adopted,
        location_warnings(numbers, cut, residual, confidence, adopted, configuration),
    )


def _in_camera(clip: Clip, ingested: IngestedMeshes) -> Array:
    vertices = ingested.meshes.vertices.astype(np.float64)
    return clip.camera.to_camera(vertices) if ingested.coordinates == "world" else vertices


def _starts(ingested: IngestedMeshes, row: int) -> list[Array]:
    """Translations (3,) at which one frame's body may stand already."""
    if ingested.coordinates == "world":
        return [np.zeros(3)]
    if ingested.first_translations is None:
        return []
    first = ingested.first_translations[row]
    return [first] if np.isfinite(first).all() else []


def _place(
    clip: Clip,
    position: int,
    points: Array,
    faces: NDArray[np.int32],
    starts: list[Array],
    configuration: LocationConfig,
) -> Placement:
    """The best translation of one frame's body, found from its mask alone."""
    mask, pad = clip.masks[position], configuration.crop_pad
    grid = grid_crop(mask, clip, configuration)
    fine = MaskCrop.around(mask, clip.camera, configuration.outline_px, pad)
    # A given place far nearer than the true one fills the crop, where no shift improves it.
    starts = [first_guess(points, faces, grid), *starts]
    start = max(starts, key=lambda start: crop_overlap(points + start, faces, grid))
    front = facing(points + start, faces)
    best = search_grid(points, front, grid, start, configuration.spans, configuration.depths)
    front = facing(points + best.translation, faces)
    refined = fit_outline(
        points,
        front,
        fine,
        best.translation,
        configuration.outline_iterations,
        configuration.usual_offset_m,
    )
    return Placement(refined, crop_overlap(points + refined, front, fine))


def _smooth(
    clip: Clip,
    frame_indices: NDArray[np.int32],
    found: Array,
    confidence: Array,
    configuration: LocationConfig,
) -> tuple[Array, Array]:
    """The path (T, 3) of the body's centre in the camera's axes, and how much of each frame's
    confidence (T,) is kept: little where the frame disagrees with those around it.

    Depth is the noisy part; the direction to the body is kept by its own small noise, and the
    position follows along the ray.
    """
    numbers = np.arange(frame_indices[0], frame_indices[-1] + 1)
    rows = frame_indices - frame_indices[0]
    typical_m = float(np.median(found[confidence > 0, 2]))
    # Directions as lateral metres at the typical depth, so that one noise fits all.
    lateral = typical_m * found[:, :2] / found[:, 2:]
    spread, weights = np.zeros((len(numbers), 3)), np.zeros(len(numbers))
    spread[rows] = np.nan_to_num(np.column_stack([lateral, found[:, 2]]))
    weights[rows] = confidence
    lateral_m, depth_m = configuration.lateral_noise_m, configuration.depth_noise_m
    path, kept = robust_path(
        spread,
        weights,
        np.array([lateral_m, lateral_m, depth_m]),
        configuration.acceleration_m_s2,
        _source_step_s(clip),
    )
    x, y, depth = path[rows].T
    path = np.stack([x * depth / typical_m, y * depth / typical_m, depth], axis=-1)
    return path, kept[rows]


def _source_step_s(clip: Clip) -> float:
    """Seconds between source frames: the clip's numbers are the source's, its rate the working."""
    working = clip.frame_indices[~clip.held_out]
    if len(working) < 2:
        return 1.0 / clip.fps
    return 1.0 / (clip.fps * float(np.median(np.diff(working))))
