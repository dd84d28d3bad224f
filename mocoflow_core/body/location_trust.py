"""How far the places that a search found can be trusted, frame by frame and as a whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.grid_search import Placement
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.mask_crop import NEAR_M, MaskCrop
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.strange_frames import listed

Array = NDArray[np.float64]


def grid_crop(mask: NDArray[np.bool_], clip: Clip, configuration: LocationConfig) -> MaskCrop:
    """Where one frame's grid is searched."""
    return MaskCrop.around(mask, clip.camera, configuration.grid_px, configuration.crop_pad)


def crop_overlap(points: Array, faces: NDArray[np.int32], crop: MaskCrop) -> float:
    """Intersection over union of a body (V, 3) in the camera's axes with a crop's mask."""
    drawn, mask = crop.draw(points, faces) & crop.seen, crop.coverage > 0.5
    return float((drawn & mask).sum() / max((drawn | mask).sum(), 1))


def placement_confidence(
    clip: Clip, points: Array, placement: Placement, configuration: LocationConfig
) -> float:
    """How well the placed body (V, 3) fits the mask, and how much of it the image shows."""
    least = configuration.least_overlap
    trust = max(placement.overlap - least, 0.0) / (1 - least)
    placed = (points + placement.translation) @ clip.camera.K.T
    pixels = placed[:, :2] / np.maximum(placed[:, 2:], NEAR_M)
    size = (clip.camera.width, clip.camera.height)
    in_sight = float(((pixels >= 0) & (pixels <= size)).all(axis=1).mean())
    return trust * in_sight**configuration.cut_power


def unexplained(crops: Sequence[MaskCrop], bodies: Array, faces: NDArray[np.int32]) -> float:
    """Mean share of the masks and bodies together where only one of both is.

    In the mean over the frames, so that a few that are far off count.

    Args:
        bodies: (S, V, 3) in the camera's axes, one for each crop.
    """
    overlaps = [
        crop_overlap(points, faces, crop) for points, crop in zip(bodies, crops, strict=True)
    ]
    return 1 - float(np.mean(overlaps))


def location_warnings(
    numbers: NDArray[np.int32],
    cut: NDArray[np.int32],
    residual: Array,
    confidence: Array,
    adopted: bool,
    configuration: LocationConfig,
) -> tuple[str, ...]:
    """What people should know of the places found.

    Args:
        numbers: (T,) of the source.
        cut: those of masks that the border cuts.
        adopted: whether the bodies stand there now.
    """
    searched = np.isfinite(residual)
    overlap = 1 - float(np.median(residual[searched]))
    if not adopted:
        return (
            f"the given location stays, as others explain the masks hardly better (overlap of the "
            f"best ones: {overlap:.2f}): the poses may be wrong rather than the place",
        )
    doubtful = numbers[searched & (confidence <= configuration.doubtful)]
    warnings = []
    if len(cut):
        warnings.append(
            f"{len(cut)} of {searched.sum()} masks are cut by the image border "
            f"({listed(cut.tolist())}): the body is located from what is seen of it"
        )
    if len(doubtful):
        warnings.append(
            f"{len(doubtful)} of {searched.sum()} masks fit badly or disagree with the frames "
            f"around ({listed(doubtful.tolist())}): the location there follows its neighbours"
        )
    if overlap < configuration.least_overlap + 0.2:
        warnings.append(f"the located body overlaps the masks by {overlap:.2f} only")
    return tuple(warnings)
