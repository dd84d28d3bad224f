"""MoveNet Thunder: COCO-17 keypoints of the person in a box. Origin: ``weights/NOTICE.md``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.perception.embedded import embedded_weights, graph_network
from mocoflow_core.perception.patch import around_box, batches
from mocoflow_core.perception.person import COCO17, Keypoints, Picture

# The network's own sizes, and the two constants of its decoding.
SIDE_PX = 256
CELLS = 64
NEARNESS_CELLS = 1.8  # A heat map counts as heat / (distance from the expected place + this).
BOX_MARGIN = 1.25
BATCH = 1  # More at once leave the cache and take longer each.


class MoveNetThunder:
    """Finds the points of one person inside a square 1.25 times the box's longer side."""

    def __init__(self) -> None:
        weights = embedded_weights("movenet_thunder")
        self.name = "MoveNet-Thunder"
        self.digest = weights.digest
        self._network = graph_network(weights)

    def keypoints(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[Keypoints | None]:
        """One pose a picture; doubtful points have a low confidence, none is left out."""
        squares = [around_box(box, BOX_MARGIN) for box in boxes]
        patches = [
            square.sample(image, SIDE_PX) for square, image in zip(squares, images, strict=True)
        ]
        found: list[Keypoints | None] = []
        for batch in batches(patches, BATCH):
            outputs = self._network(batch / 127.5 - 1.0)
            for heat, regression, centre, offset in zip(*outputs, strict=True):
                places, confidence = decode(heat, regression, centre, offset)
                square = squares[len(found)]
                in_picture = square.to_picture(places * (SIDE_PX / CELLS), SIDE_PX)
                found.append(Keypoints(in_picture, confidence))
        return found


def decode(
    heat: Tensor, regression: Tensor, centre: Tensor, offset: Tensor
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Places (17, 2) x y in cells and confidences (17,) of one person.

    The person's centre is the strongest cell near the patch's middle; it says where each point is
    to be expected; each heat map is weighted towards that place; its strongest cell is corrected
    by an offset.

    Args:
        heat: (17, C, C) logits.
        regression: (34, C, C) expected y, x of each point, relative to the centre's cell.
        centre: (1, C, C) logits.
        offset: (34, C, C) y, x corrections.
    """
    y, x = torch.meshgrid(torch.arange(CELLS), torch.arange(CELLS), indexing="ij")
    middle = _nearness(y - CELLS / 2, x - CELLS / 2)
    row, column = divmod(int((centre[0].sigmoid() * middle).argmax()), CELLS)
    expected = regression[:, row, column].view(len(COCO17), 2, 1, 1)
    shares = heat.sigmoid()
    near = _nearness(y - row - expected[:, 0], x - column - expected[:, 1])
    strongest = (shares * near).flatten(1).argmax(dim=1)
    rows, columns = strongest // CELLS, strongest % CELLS
    points = torch.arange(len(COCO17))
    corrections = offset.view(len(COCO17), 2, CELLS, CELLS)[points, :, rows, columns]
    places = torch.stack([columns + corrections[:, 1], rows + corrections[:, 0]], dim=1)
    return places.numpy(), shares[points, rows, columns].numpy()


def _nearness(y: Tensor, x: Tensor) -> Tensor:
    """1 / (distance + a constant), of cells away from a place by y, x."""
    return 1.0 / (torch.sqrt(y * y + x * x) + NEARNESS_CELLS)
