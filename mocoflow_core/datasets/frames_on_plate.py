"""Frames with the person cut out and set before an empty background: no cast shadow stays."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import FrameSource, Image
from mocoflow_core.datasets.dataset_scene import MaskSource


@dataclass(frozen=True, eq=False)
class FramesOnPlate:
    """Pixels outside the masks are the plate's (MoCo-Flow sec. 4, AIST).

    Frames without a mask stay as the camera saw them.
    """

    source: FrameSource
    masks: MaskSource
    plate: Image  # (H, W, 3)

    @property
    def indices(self) -> NDArray[np.int32]:
        return self.source.indices

    @property
    def files(self) -> list[Path]:
        return list(dict.fromkeys([*self.source.files, *self.masks.files]))

    @property
    def fps(self) -> float | None:
        return self.source.fps

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
        masked = np.intersect1d(sorted(wanted), self.masks.indices).tolist()
        masks = self.masks.read(masked)
        cut = set(masked)
        for number, image in self.source.read(wanted):
            if number in cut:
                _, mask = next(masks)
                image = np.where(mask[..., None], image, self.plate)
            yield number, image
