"""What a detector saw of a person: landmarks over a clip, in the order of ``LANDMARKS``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fittable_body import LANDMARKS, FittableBody
from mocoflow_core.body.fit.landmark_offsets import BLAZEPOSE_OFFSETS
from mocoflow_core.body.fit.posed_body import Mixtures
from mocoflow_core.errors import InputError

Array = NDArray[np.float64]

# ``LANDMARKS`` among BlazePose's 33.
_OF_BLAZEPOSE = [0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32]
# A frame with fewer landmarks than this shows nobody.
_LEAST_LANDMARKS = 4


@dataclass(frozen=True, eq=False)
class Sightings:
    """Landmarks of each frame; confidence 0 is unseen."""

    places: Array  # (T, 21, 2) pixels, corner origin
    confidence: Array  # (T, 21) in [0, 1]
    world: Array | None = None  # (T, 21, 3) metres, the camera's axes, origin and scale unknown
    offsets: Array | None = None  # (21, 3) from Anny's points to the detector's, metres

    @classmethod
    def of(
        cls,
        places: NDArray[np.floating],
        confidence: NDArray[np.floating],
        world: NDArray[np.floating] | None = None,
    ) -> Self:
        """From COCO-17 or BlazePose-33: places (T, K, 2), confidence (T, K), world (T, K, 3).

        What is not finite counts as unseen. 33 landmarks are taken where BlazePose sees them, 17
        where Anny has COCO's.

        Raises InputError for other counts, sizes that disagree, and where nobody is seen.
        """
        count = places.shape[1] if places.ndim == 3 else 0
        shapes = [(*places.shape[:2], 2), (*confidence.shape, 2)]
        if world is not None:
            shapes.append((*world.shape[:2], 2))
        if count not in (17, 33) or any(shape != places.shape for shape in shapes):
            raise InputError(
                "landmarks (T, 17 or 33, 2) with a confidence each",
                f"{places.shape} with {confidence.shape}",
                "Give COCO-17 keypoints or BlazePose's 33 landmarks.",
            )
        chosen = _OF_BLAZEPOSE if count == 33 else list(range(17))
        seen = np.isfinite(places).all(-1) & np.isfinite(confidence)
        trust = np.where(seen, np.nan_to_num(confidence), 0.0).clip(0, 1)[:, chosen]
        if not (trust > 0).sum(1).max(initial=0) >= _LEAST_LANDMARKS:
            raise InputError("a frame with a person", "no landmarks at all", "Check the video.")
        missing = len(LANDMARKS) - len(chosen)
        deep = None
        if world is not None:
            deep = _padded(np.nan_to_num(world[:, chosen]), missing)
        return cls(
            _padded(np.nan_to_num(places[:, chosen]), missing),
            _padded(trust, missing),
            deep,
            BLAZEPOSE_OFFSETS if count == 33 else None,
        )

    def of_frames(self, chosen: NDArray[np.bool_]) -> Sightings:
        """The same with nothing seen in all frames but the chosen ones (T,).

        Raises InputError where they show nobody.
        """
        kept = replace(self, confidence=np.where(chosen[:, None], self.confidence, 0.0))
        if not kept.seen.any():
            raise InputError("a frame with a person", "no landmarks at all", "Check the video.")
        return kept

    def points(self, body: FittableBody) -> Mixtures:
        """The body's points that the detector would see, in the mean shape."""
        return Mixtures.of(body, body.regressor, self.offsets)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(T,) frames in which a person is seen."""
        return (self.confidence > 0).sum(1) >= _LEAST_LANDMARKS


def _padded(values: NDArray[np.floating], missing: int) -> Array:
    widths = [(0, 0), (0, missing)] + [(0, 0)] * (values.ndim - 2)
    return np.pad(values.astype(np.float64), widths)
