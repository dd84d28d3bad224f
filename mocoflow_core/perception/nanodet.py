"""NanoDet: boxes of persons with their confidence. Weights and origin: ``weights/NOTICE.md``."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.perception.embedded import embedded_weights, graph_network
from mocoflow_core.perception.patch import Square, batches, whole_picture
from mocoflow_core.perception.person import Boxes, Picture

# What the network was trained with; other values would be another network.
SIDE_PX = 416
STRIDES_PX = (8, 16, 32)
CLASSES = 80
PERSON = 0
BINS = 11  # of the distribution over each distance from a cell to a side of its box
MEAN_BGR = (103.53, 116.28, 123.675)
STD_BGR = (57.375, 57.12, 58.395)
OVERLAP = 0.6  # Of two boxes that overlap more, the less confident one is dropped.
BATCH = 4


class NanoDet:
    """Finds persons of any size; the picture is scaled so that its longer side has 416 px."""

    def __init__(self, least_confidence: float = 0.2) -> None:
        """Boxes below ``least_confidence`` are not given."""
        weights = embedded_weights("nanodet")
        self.name = "NanoDet-416"
        self.digest = weights.digest
        self._least = least_confidence
        self._network = graph_network(weights)
        self._centres = _cell_centres()

    def boxes(self, images: Sequence[Picture]) -> list[Boxes]:
        """Persons of each picture, most confident first."""
        squares = [whole_picture(image) for image in images]
        patches = [
            square.sample(image, SIDE_PX)[..., ::-1]
            for square, image in zip(squares, images, strict=True)
        ]
        mean = torch.tensor(MEAN_BGR).view(1, 3, 1, 1)
        std = torch.tensor(STD_BGR).view(1, 3, 1, 1)
        found: list[Boxes] = []
        for batch in batches(patches, BATCH):
            levels = self._network((batch - mean) / std)
            cells = torch.cat([level.flatten(2) for level in levels], dim=2)
            found += [
                self._boxes(cell, squares[len(found) + row], images[len(found) + row])
                for row, cell in enumerate(cells)
            ]
        return found

    def _boxes(self, cells: Tensor, square: Square, image: Picture) -> Boxes:
        """Persons among the cells (CLASSES + 4 * BINS, N) of one picture."""
        confidence = cells[PERSON].sigmoid()
        kept = confidence > self._least
        corners = self._corners(cells[CLASSES:, kept], kept)
        chosen = _without_overlaps(corners, confidence[kept].numpy())
        places = square.to_picture(corners.reshape(-1, 2, 2), SIDE_PX).reshape(-1, 4)
        height, width = image.shape[:2]
        limits = np.array([width, height, width, height], np.float32)
        return Boxes(np.clip(places, 0.0, limits)[chosen], confidence[kept].numpy()[chosen])

    def _corners(self, cells: Tensor, kept: Tensor) -> NDArray[np.float32]:
        """Boxes (N, 4) in patch pixels from distributions (4 * BINS, N)."""
        centres, strides = self._centres
        shares = cells.T.reshape(-1, 4, BINS).softmax(dim=2)
        distances = (shares @ torch.arange(BINS).float()) * strides[kept, None]
        x, y = centres[kept].T
        left, top, right, bottom = distances.T
        return torch.stack([x - left, y - top, x + right, y + bottom], dim=1).numpy()


def _cell_centres() -> tuple[Tensor, Tensor]:
    """Centres (N, 2) in patch pixels and strides (N,) of all cells, row by row, level by level."""
    centres, strides = [], []
    for stride in STRIDES_PX:
        steps = (torch.arange(SIDE_PX // stride) + 0.5) * stride
        y, x = torch.meshgrid(steps, steps, indexing="ij")
        centres.append(torch.stack([x, y], dim=-1).reshape(-1, 2))
        strides.append(torch.full((len(centres[-1]),), float(stride)))
    return torch.cat(centres), torch.cat(strides)


def _without_overlaps(
    corners: NDArray[np.float32], confidence: NDArray[np.float32]
) -> NDArray[np.int64]:
    """Indices of the boxes that stay, most confident first."""
    sizes = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
    chosen = cv2.dnn.NMSBoxes(sizes.tolist(), confidence.tolist(), 0.0, OVERLAP)
    return np.asarray(chosen, np.int64).reshape(-1)
