"""Triangulated keypoints of AIST++: truth, for metrics alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.datasets.dataset_scene import DatasetTruth
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted

# The smoothed ones first.
KEYS = ("keypoints3d_optim", "keypoints3d")
COCO_KEYPOINTS = 17


def read_keypoints(file: Path, unit_m: float) -> tuple[NDArray[np.float32], str]:
    """COCO keypoints (N, 17, 3) in world metres, nan where unknown, and the key they had.

    Raises InputError for another content.
    """
    content = read_untrusted(file)
    key = next((key for key in KEYS if isinstance(content, dict) and key in content), None)
    points = np.asarray(content[key], np.float64) if key and isinstance(content, dict) else None
    if key is None or points is None or points.shape[1:] != (COCO_KEYPOINTS, 3):
        raise InputError(
            f"{' or '.join(KEYS)} of N x 17 x 3 in {file.name}",
            f"{sorted(map(str, content)) if isinstance(content, dict) else type(content).__name__}",
            "Unpack the AIST++ annotations again.",
        )
    return (unit_m * points).astype(np.float32), key


def keypoint_truth(
    file: Path, clip: NDArray[np.int32], unit_m: float
) -> tuple[DatasetTruth | None, tuple[str, ...]]:
    """The keypoints of the clip's frames, and remarks."""
    if not file.is_file():
        return None, (f"no keypoints3d/{file.name}: nothing is scored against joints",)
    keypoints, key = read_keypoints(file, unit_m)
    inside = clip[clip < len(keypoints)]
    remarks = [f"joints to score against are {key} of AIST++, triangulated, nan where unknown"]
    if len(inside) < len(clip):
        remarks.append(f"{len(clip) - len(inside)} frames of the clip have no keypoints")
    if not len(inside):
        return None, tuple(remarks)
    return DatasetTruth(inside, keypoints3d=keypoints[inside]), tuple(remarks)
