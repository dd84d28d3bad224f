"""Which pose belongs to which frame, where a data set has more poses than frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.datasets.sampled_masks import SampledMasks

PoseAlignment = Literal["auto", "start", "end"]
# Below it two alignments cannot be told apart by outlines.
TELLING_DIFFERENCE = 0.001


@dataclass(frozen=True)
class AlignedPoses:
    """Pose ``number + shift`` belongs to frame ``number``; how silhouettes agree, by shift."""

    shift: int
    overlaps: dict[int, float]
    remark: str


def align_poses(
    alignment: PoseAlignment,
    surplus: int,
    sampled: SampledMasks,
    pose: Callable[[NDArray[np.int32]], MeshSequence],
) -> AlignedPoses:
    """Decide by the overlap of posed bodies with the masks, or as told, and measure it.

    Args:
        surplus: number of poses above that of the frames; negative where there are fewer.
        pose: bodies in world metres of the poses of given rows; rows that do not exist left out.
    """
    ends = {"start": 0, "end": surplus}
    candidates = (0, surplus) if alignment == "auto" else (ends[alignment],)
    looked_at = sorted({end + step for end in candidates for step in (-1, 0, 1)})
    rows = np.unique(np.concatenate([sampled.numbers + shift for shift in looked_at]))
    bodies = pose(rows.astype(np.int32))
    overlaps = {shift: sampled.overlap(bodies, shift) for shift in looked_at}
    shift = max(candidates, key=lambda candidate: overlaps[candidate])
    return AlignedPoses(shift, overlaps, _in_words(alignment, surplus, shift, overlaps))


def _in_words(
    alignment: PoseAlignment, surplus: int, shift: int, overlaps: dict[int, float]
) -> str:
    side = "from the first on" if shift == 0 else "from the last back"
    measured = ", ".join(f"{overlaps[shift + step]:.4f} at {step:+d}" for step in (-1, 0, 1))
    text = f"poses and frames are joined {side} (shift {shift:+d}): overlap (IoU) {measured}"
    if alignment != "auto" or surplus == 0:
        return text
    other = surplus - shift
    gain = overlaps[shift] - overlaps[other]
    text += f"; {gain:.4f} better than the other end"
    return text if gain > TELLING_DIFFERENCE else f"{text}, which hardly tells them apart"
