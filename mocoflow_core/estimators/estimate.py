"""One person as a body estimator saw them: what every reader makes of its tool's files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.scene_description import Coordinates

Numbering = Literal["position", "source"]


@dataclass(frozen=True, eq=False)
class BodyEstimate:
    """A body per frame, metres, and where it is known to stand.

    ``coordinates``: "world"; "camera", the train camera's axes and origin, for its intrinsics;
    "camera-root-centred", its axes alone. ``located`` is true where the translation can be
    trusted. ``first_translations`` say about where root-centred bodies stand in the train
    camera's axes; nan where unknown.

    ``numbering``: frames by their position in what the tool was given, or by source number.
    """

    source: str  # the tool
    frame_indices: NDArray[np.int32]  # (T,)
    numbering: Numbering
    vertices: NDArray[np.float32]  # (T, V, 3)
    faces: NDArray[np.int32]  # (F, 3)
    coordinates: Coordinates
    located: bool
    first_translations: NDArray[np.float64] | None = None  # (T, 3)
    keypoint_regressor: NDArray[np.float32] | None = None  # (17, V)
    remarks: tuple[str, ...] = ()  # what was chosen, corrected or assumed, in words
