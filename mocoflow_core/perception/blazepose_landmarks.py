"""BlazePose's landmark network: 33 points, in the picture and in space, and the person's mask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit

from mocoflow_core.perception.blazepose_detector import REGION_MARGIN, upright_region
from mocoflow_core.perception.embedded import embedded_weights, graph_network
from mocoflow_core.perception.patch import batches
from mocoflow_core.perception.person import BodyLandmarks, Keypoints, Picture
from mocoflow_core.perception.region import Region

SIZE = 256
BATCH = 8
BODY = 33  # landmarks; behind them hips and extent for the next region
HIPS, EXTENT = 33, 34
# Landmarks are moved to the middle of mass of their heat map near them, where it is certain.
WINDOW, CERTAIN = 7, 0.5
# The landmarks that are COCO's keypoints, in their order.
COCO_LANDMARKS = (0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28)


@dataclass(frozen=True, eq=False)
class Pose:
    """What is found of one person in one picture."""

    landmarks: BodyLandmarks
    presence: float  # that there is a person, [0, 1]
    region: Region  # where it was looked for
    region_mask: NDArray[np.float16]  # (256, 256) of the region, in [0, 1]
    next_region: Region  # where to look for this person again

    @property
    def keypoints(self) -> Keypoints:
        chosen = list(COCO_LANDMARKS)
        return Keypoints(self.landmarks.places[chosen], self.landmarks.visibility[chosen])

    def mask(self, height: int, width: int) -> NDArray[np.float32]:
        """The person's mask (H, W) in [0, 1], zero outside the region."""
        return self.region.laid_back(self.region_mask, height, width)


class BlazePoseLandmarks:
    """Runs the network on batches of regions."""

    def __init__(self, device: str = "cpu") -> None:
        weights = embedded_weights("blazepose_landmark_heavy")
        self.digest = weights.digest
        self._network = graph_network(weights).to(device)
        self._device = device

    def poses(self, pictures: Sequence[Picture], regions: Sequence[Region]) -> list[Pose]:
        """The person of each region of its picture; ``presence`` says whether there is one."""
        cuts = [
            region.cut(picture, SIZE) for picture, region in zip(pictures, regions, strict=True)
        ]
        found: list[Pose] = []
        for batch in batches(cuts, BATCH):
            inputs = batch.to(self._device, memory_format=torch.channels_last) / 255
            outputs = [output.cpu().numpy() for output in self._network(inputs)]
            for values in zip(*outputs, strict=True):
                landmarks, flag, mask, heat, world = values
                found.append(_pose(landmarks, flag, mask, heat, world, regions[len(found)]))
        return found


def _pose(
    landmarks: NDArray[np.float32],  # (195, 1, 1): x y depth visibility presence of 39
    flag: NDArray[np.float32],  # (1, 1, 1)
    mask: NDArray[np.float32],  # (1, 256, 256), before the sigmoid
    heat: NDArray[np.float32],  # (39, 64, 64), before the sigmoid
    world: NDArray[np.float32],  # (117, 1, 1): 39 points
    region: Region,
) -> Pose:
    raw = landmarks.reshape(39, 5)
    places = region.places(_refined(raw[:, :2] / np.float32(SIZE), expit(heat)))
    points = world.reshape(39, 3)[:BODY].copy()
    points[:, :2] = points[:, :2] @ region.rotation.T
    return Pose(
        BodyLandmarks(
            places=places[:BODY],
            depth=raw[:BODY, 2] * np.float32(region.side / SIZE),
            world=points,
            visibility=expit(raw[:BODY, 3]),
        ),
        presence=float(flag.item()),
        region=region,
        region_mask=expit(mask[0]).astype(np.float16),
        next_region=upright_region(places[HIPS], places[EXTENT]).widened(REGION_MARGIN),
    )


def _refined(inside: NDArray[np.float32], heat: NDArray[np.float32]) -> NDArray[np.float32]:
    """Landmarks (39, 2), [0, 1] across the region, by their heat maps (39, H, W)."""
    refined = inside.copy()
    height, width = heat.shape[1:]
    for number, (column, row) in enumerate((inside * (width, height)).astype(int)):
        if not (0 <= column < width and 0 <= row < height):
            continue
        top, left = max(row - WINDOW // 2, 0), max(column - WINDOW // 2, 0)
        near = heat[number, top : row + WINDOW // 2 + 1, left : column + WINDOW // 2 + 1]
        if near.max() < CERTAIN:
            continue
        rows, columns = np.indices(near.shape)
        total = near.sum()
        middle = (near * columns).sum() / total + left, (near * rows).sum() / total + top
        refined[number] = np.array(middle) / (width, height)
    return refined
