"""BlazePose's detector: where persons are, by the middle of the hips and the body's extent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit
from torch import Tensor

from mocoflow_core.perception.embedded import embedded_weights, graph_network
from mocoflow_core.perception.overlap import overlaps
from mocoflow_core.perception.patch import batches
from mocoflow_core.perception.person import Picture
from mocoflow_core.perception.region import Region

SIZE = 224
BATCH = 8
# Cells of the grids, and anchors in each cell.
GRIDS = ((28, 2), (14, 2), (7, 6))
LEAST_CONFIDENCE = 0.5
SAME_PERSON_OVERLAP = 0.3
HIPS, EXTENT = 0, 1
POINTS = (0, 2, 3, 4, 5)  # of what the network gives; 1 is a size, which no anchor moves
# A landmark network wants the circle about the person a little larger.
REGION_MARGIN = 1.25


@dataclass(frozen=True, eq=False)
class Detection:
    """A person: its head's box and four points, pixels."""

    head: NDArray[np.float32]  # (4,) x0 y0 x1 y1
    points: NDArray[np.float32]  # (4, 2): hips, extent, shoulders, extent of the upper body
    confidence: float

    @property
    def circle(self) -> Region:
        """The square about the circle that holds the person, the body's axis upright in it."""
        return upright_region(self.points[HIPS], self.points[EXTENT])


def upright_region(hips: NDArray[np.floating], extent: NDArray[np.floating]) -> Region:
    """About the hips, so large and turned that ``extent`` is the middle of its upper side."""
    across, down = (float(value) for value in extent - hips)
    angle = math.atan2(across, -down)
    return Region((float(hips[0]), float(hips[1])), 2 * math.hypot(across, down), angle)


class BlazePoseDetector:
    """Runs the network on batches of pictures."""

    def __init__(self, device: str = "cpu") -> None:
        weights = embedded_weights("blazepose_detector")
        self.digest = weights.digest
        self._network = graph_network(weights).to(device)
        self._device = device

    def detect(
        self, pictures: Sequence[Picture], regions: Sequence[Region]
    ) -> list[list[Detection]]:
        """The persons of each region of its picture, most confident first."""
        cuts = [
            region.cut(picture, SIZE) for picture, region in zip(pictures, regions, strict=True)
        ]
        found: list[list[Detection]] = []
        for batch in batches(cuts, BATCH):
            places, confidence = self._candidates(batch)
            found += [
                [_in_picture(merged, regions[len(found) + row]) for merged in _merge(*candidates)]
                for row, candidates in enumerate(zip(places, confidence, strict=True))
            ]
        return found

    def _candidates(self, batch: Tensor) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Places (B, anchors, 6, 2) as ``_merge`` takes them, and their confidence."""
        pictures = batch.to(self._device, memory_format=torch.channels_last) / 127.5 - 1
        grids = self._network(pictures)
        places = _joined(grids[: len(GRIDS)], 12).reshape(len(batch), -1, 6, 2)
        places /= np.float32(SIZE)
        places[:, :, POINTS] += _anchors()[:, None]
        return places, expit(_joined(grids[len(GRIDS) :], 1)[..., 0])


def _joined(grids: Sequence[Tensor], width: int) -> NDArray[np.float32]:
    """(B, anchors, width) of all grids, row by row, anchors of a cell together."""
    parts = [grid.permute(0, 2, 3, 1).reshape(len(grid), -1, width) for grid in grids]
    joined: NDArray[np.float32] = torch.cat(parts, 1).cpu().numpy()
    return joined


def _anchors() -> NDArray[np.float32]:
    """(2254, 2) middles of cells, [0, 1] across the picture."""
    listed = []
    for cells, repeats in GRIDS:
        middles = (np.arange(cells) + 0.5) / cells
        grid = np.stack(np.meshgrid(middles, middles), -1).reshape(-1, 2)
        listed.append(np.repeat(grid, repeats, axis=0))
    return np.concatenate(listed).astype(np.float32)


def _merge(
    places: NDArray[np.float32], confidence: NDArray[np.float32]
) -> list[tuple[NDArray[np.float32], float]]:
    """Candidates of one person become their mean, weighted by confidence.

    Args:
        places: (N, 6, 2) middle and size of a box, four points.
    """
    chosen = np.flatnonzero(confidence >= LEAST_CONFIDENCE)
    chosen = chosen[np.argsort(-confidence[chosen], kind="stable")]
    boxes = _corners(places[:, :2])
    merged = []
    while len(chosen):
        same = overlaps(boxes[chosen[0]], boxes[chosen]) > SAME_PERSON_OVERLAP
        same[0] = True
        weights = confidence[chosen[same]]
        mean = np.average(places[chosen[same]], axis=0, weights=weights)
        merged.append((mean.astype(np.float32), float(weights[0])))
        chosen = chosen[~same]
    return merged


def _corners(places: NDArray[np.float32]) -> NDArray[np.float32]:
    """x0 y0 x1 y1 (N, 4) of boxes (N, 2, 2) given by middle and size."""
    middles, sizes = places[:, 0], places[:, 1]
    return np.concatenate((middles - sizes / 2, middles + sizes / 2), axis=1)


def _in_picture(merged: tuple[NDArray[np.float32], float], region: Region) -> Detection:
    (middle, size, *points), confidence = merged
    corners = region.places(np.stack((middle - size / 2, middle + size / 2)))
    return Detection(corners.reshape(4), region.places(np.stack(points)), confidence)
