"""Where a body stands, roughly: a 3-D grid of translations, coarse to fine, against one mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mask_crop import MaskCrop

Array = NDArray[np.float64]

# A level whose best depth lies at its end is repeated around it, at most so often.
REPEATS = 6


@dataclass(frozen=True, eq=False)
class Placement:
    """A translation in the camera's axes and how well the body then covers the mask."""

    translation: Array  # (3,) metres
    overlap: float  # intersection over union


def first_guess(points: Array, faces: NDArray[np.int32], crop: MaskCrop) -> Array:
    """A translation (3,) that gives the body (V, 3) the mask's area and centre."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    rows, columns = np.nonzero(crop.coverage > 0.5)
    box_px = max(np.ptp(rows), np.ptp(columns)) + 1
    depth = crop.focal_px * (high - low).max() / box_px
    middle = np.array([np.ptp(columns) / 2 + columns.min(), np.ptp(rows) / 2 + rows.min()]) + 0.5
    ray = np.linalg.solve(crop.K, [*middle, 1.0])
    drawn = crop.draw(points - centre + depth * ray, faces)
    depth *= float(np.sqrt(max(drawn.sum(), 1) / crop.coverage.sum()))
    return depth * ray - centre


def search_grid(
    points: Array,
    faces: NDArray[np.int32],
    crop: MaskCrop,
    start: Array,
    spans: tuple[float, ...],
    depths: int,
) -> Placement:
    """Improve ``start`` (3,) level by level.

    A level tries ``depths`` distances from 1/(1 + span) to 1 + span times the best so far; at each
    distance all lateral shifts of the drawn body at once, by correlation with the mask.
    """
    spectra = np.fft.rfft2(np.stack([crop.coverage, crop.seen]), (2 * crop.side_px,) * 2)
    best = Placement(start, 0.0)
    for span in spans:
        factors = (1 + span) ** np.linspace(-1, 1, depths)
        for _ in range(REPEATS):
            tried = [
                _best_shift(points, faces, crop, spectra, _moved(points, best.translation, factor))
                for factor in factors
            ]
            choice = int(np.argmax([placement.overlap for placement in tried]))
            best = tried[choice]
            if 0 < choice < depths - 1:
                break
    return best


def _moved(points: Array, translation: Array, factor: float) -> Array:
    """The translation that brings the body's centre ``factor`` times as far on the same ray."""
    centre = points.mean(axis=0)
    return factor * (centre + translation) - centre


def _best_shift(
    points: Array,
    faces: NDArray[np.int32],
    crop: MaskCrop,
    spectra: NDArray[np.complex128],
    translation: Array,
) -> Placement:
    """The best lateral shift; ``spectra`` (2, S', S'') of the mask and of what the image shows.

    What a shift moves beyond the image's border counts for nothing.
    """
    drawn = crop.draw(points + translation, faces)
    size = (2 * crop.side_px,) * 2
    common, inside = np.fft.irfft2(spectra * np.conj(np.fft.rfft2(drawn, size)), size)
    union = crop.coverage.sum() + inside - common
    overlaps = common / np.maximum(union, 1e-6)
    row, column = np.unravel_index(int(overlaps.argmax()), size)
    shift = np.array([column, row], np.float64)
    # The correlation is cyclic: shifts in its second half point the other way.
    shift = np.where(shift >= crop.side_px, shift - 2 * crop.side_px, shift)
    depth = float((points.mean(axis=0) + translation)[2])
    lateral = shift * depth / np.array([crop.K[0, 0], crop.K[1, 1]])
    return Placement(translation + np.append(lateral, 0.0), float(overlaps[row, column]))
