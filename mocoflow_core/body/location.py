"""Where the body is: the translation of a mesh estimate without one, found from the masks.

MoCo-Flow sec. 3.1: the mesh's silhouette against the mask, a 3-D grid, coarse to fine, smooth in
time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.body.agreement import is_cut
from mocoflow_core.body.grid_search import Placement, first_guess, search_grid
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.mask_crop import MaskCrop, facing
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.outline_fit import fit_outline
from mocoflow_core.body.smooth_path import smooth_path
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError

Array = NDArray[np.float64]


class LocationConfig(ConfigurationPart):
    """How finely the location is searched, and how smooth it is in time."""

    spans: tuple[float, ...] = Field(
        (0.4, 0.15, 0.05), description="Each level tries depths up to this share nearer or farther."
    )
    depths: int = Field(5, ge=3, description="Depths tried on each level.")
    grid_px: int = Field(96, ge=16, description="Side of the crop the grid is searched on, pixels.")
    outline_px: int = Field(
        320, ge=32, description="Side of the crop the outline is fitted on, pixels."
    )
    crop_pad: float = Field(
        1.5, ge=1, description="Side of the crops, times the longer side of the mask's box."
    )
    outline_iterations: int = Field(8, ge=0, description="Most steps of the outline fit.")
    usual_offset_m: float = Field(
        0.02, gt=0, description="How far clothes or wide masks usually move an outline, metres."
    )
    least_overlap: float = Field(
        0.4, ge=0, lt=1, description="Frames that overlap less say nothing of the location."
    )
    cut_confidence: float = Field(
        0.02, ge=0, le=1, description="Confidence of a mask that the image border cuts."
    )
    depth_noise_m: float = Field(0.03, gt=0, description="Usual error of a frame's depth, metres.")
    lateral_noise_m: float = Field(
        0.005, gt=0, description="Usual error of a frame's lateral position, metres."
    )
    acceleration_m_s2: float = Field(
        4.0, gt=0, description="Usual acceleration of the body's centre, metres per square second."
    )


@dataclass(frozen=True, eq=False)
class LocatedMeshes:
    """Meshes in world metres, at every source frame, and how sure their location is."""

    meshes: MeshSequence
    translations: Array  # (T, 3) metres, what was added in the train camera's axes
    residual: Array  # (T,) 1 - overlap of the frame's own best placement; nan where not searched
    confidence: Array  # (T,) 0 where the location is interpolated
    warnings: tuple[str, ...]

    def save(self, folder: Path) -> None:
        """Write ``meshes.npz`` and ``location.npz`` into an existing folder."""
        self.meshes.save(folder / "meshes.npz")
        with (folder / "location.npz").open("wb") as file:
            np.savez(
                file,
                translations=self.translations,
                residual=self.residual,
                confidence=self.confidence,
                warnings=np.array(self.warnings, dtype=np.str_),
            )

    @classmethod
    def load(cls, folder: Path) -> LocatedMeshes:
        """Inverse of ``save``."""
        with np.load(folder / "location.npz", allow_pickle=False) as arrays:
            return cls(
                MeshSequence.load(folder / "meshes.npz"),
                arrays["translations"],
                arrays["residual"],
                arrays["confidence"],
                tuple(str(warning) for warning in arrays["warnings"]),
            )


def locate_body(
    clip: Clip,
    ingested: IngestedMeshes,
    configuration: LocationConfig,
    progress: Callable[[float, str], None] = lambda fraction, text: None,
) -> LocatedMeshes:
    """Find the body's translation in each frame from the train camera's masks.

    Root-centred meshes are searched from the mask's size; others from where they are given.
    Held-out frames, frames without a mask and frames between those of the clip are interpolated;
    masks cut by the image border count little.

    Raises InputError when no mask shows the person.
    """
    posed = _in_camera(clip, ingested)
    searched = np.flatnonzero(~clip.held_out & clip.masks.any(axis=(1, 2)))
    if not len(searched):
        raise InputError("a mask that shows the person", "empty masks only", "Check the masks.")
    rows = {int(index): row for row, index in enumerate(ingested.meshes.frame_indices)}
    centres = posed.mean(axis=1)
    found = np.full((len(posed), 3), np.nan)
    residual = np.full(len(posed), np.nan)
    confidence = np.zeros(len(posed))
    for done, position in enumerate(searched.tolist()):
        row = rows[int(clip.frame_indices[position])]
        placement = _place(clip, position, posed[row], ingested, configuration)
        found[row] = centres[row] + placement.translation
        residual[row] = 1 - placement.overlap
        confidence[row] = _confidence(clip.masks[position], placement, configuration)
        progress((done + 1) / len(searched), f"located frame {clip.frame_indices[position]}")
    if not confidence.any():
        # No frame can be trusted more than another: all count alike.
        confidence = np.where(np.isfinite(residual), configuration.cut_confidence, 0.0)
    path = _smooth(clip, ingested.meshes.frame_indices, found, confidence, configuration)
    translations = path - centres
    world = clip.camera.to_world(posed + translations[:, None])
    return LocatedMeshes(
        replace(ingested.meshes, vertices=world.astype(np.float32)),
        translations,
        residual,
        confidence,
        _warnings(residual, confidence, configuration),
    )


def _in_camera(clip: Clip, ingested: IngestedMeshes) -> Array:
    vertices = ingested.meshes.vertices.astype(np.float64)
    return clip.camera.to_camera(vertices) if ingested.coordinates == "world" else vertices


def _place(
    clip: Clip,
    position: int,
    points: Array,
    ingested: IngestedMeshes,
    configuration: LocationConfig,
) -> Placement:
    """The best translation of one frame's body, found from its mask alone."""
    mask, pad = clip.masks[position], configuration.crop_pad
    grid = MaskCrop.around(mask, clip.camera, configuration.grid_px, pad)
    fine = MaskCrop.around(mask, clip.camera, configuration.outline_px, pad)
    faces = ingested.meshes.faces
    starts = [first_guess(points, faces, grid)]
    if ingested.coordinates != "camera-root-centred":
        starts.append(np.zeros(3))
    # A given place far nearer than the true one fills the crop, where no shift improves it.
    start = max(starts, key=lambda start: _overlap(points + start, faces, grid))
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
    return Placement(refined, _overlap(points + refined, front, fine))


def _overlap(points: Array, faces: NDArray[np.int32], crop: MaskCrop) -> float:
    drawn, mask = crop.draw(points, faces) & crop.seen, crop.coverage > 0.5
    return float((drawn & mask).sum() / max((drawn | mask).sum(), 1))


def _confidence(
    mask: NDArray[np.bool_], placement: Placement, configuration: LocationConfig
) -> float:
    least = configuration.least_overlap
    trust = max(placement.overlap - least, 0.0) / (1 - least)
    return trust * (configuration.cut_confidence if is_cut(mask) else 1.0)


def _smooth(
    clip: Clip,
    frame_indices: NDArray[np.int32],
    found: Array,
    confidence: Array,
    configuration: LocationConfig,
) -> Array:
    """The path (T, 3) of the body's centre, in the camera's axes.

    Depth is the noisy part, so it is smoothed first; the direction to the body is kept by its own
    small noise, and the position follows along the ray.
    """
    numbers = np.arange(frame_indices[0], frame_indices[-1] + 1)
    rows = frame_indices - frame_indices[0]
    step_s = _source_step_s(clip)
    weights = np.zeros(len(numbers))
    weights[rows] = confidence
    typical_m = float(np.median(found[confidence > 0, 2]))

    def smoothed(values: Array, noise_m: float) -> Array:
        spread = np.zeros(len(numbers))
        spread[rows] = np.nan_to_num(values)
        return smooth_path(spread, weights, noise_m, configuration.acceleration_m_s2, step_s)[rows]

    depth = smoothed(found[:, 2], configuration.depth_noise_m)
    # Directions as lateral metres at the typical depth, so that one noise fits all.
    lateral = typical_m * found[:, :2] / found[:, 2:]
    x = smoothed(lateral[:, 0], configuration.lateral_noise_m)
    y = smoothed(lateral[:, 1], configuration.lateral_noise_m)
    return np.stack([x * depth / typical_m, y * depth / typical_m, depth], axis=-1)


def _source_step_s(clip: Clip) -> float:
    """Seconds between source frames: the clip's numbers are the source's, its rate the working."""
    working = clip.frame_indices[~clip.held_out]
    if len(working) < 2:
        return 1.0 / clip.fps
    return 1.0 / (clip.fps * float(np.median(np.diff(working))))


def _warnings(residual: Array, confidence: Array, configuration: LocationConfig) -> tuple[str, ...]:
    searched = np.isfinite(residual)
    overlap = 1 - float(np.median(residual[searched]))
    poor = int((searched & (confidence <= configuration.cut_confidence)).sum())
    warnings = []
    if poor:
        warnings.append(
            f"{poor} of {searched.sum()} masks are cut by the image border or fit badly: "
            "the location there follows the neighbouring frames"
        )
    if overlap < configuration.least_overlap + 0.2:
        warnings.append(f"the located body overlaps the masks by {overlap:.2f} only")
    return tuple(warnings)
