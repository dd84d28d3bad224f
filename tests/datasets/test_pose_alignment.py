"""Which pose belongs to which frame is decided by outlines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.datasets.pose_alignment import align_poses
from mocoflow_core.datasets.sampled_masks import sample_masks
from tests.datasets.in_memory import walking_dataset

SCENE = walking_dataset(frames=9, first=0)
FRONT = SCENE.cameras["front"]
BODIES = SCENE.meshes.sequence
SAMPLED = sample_masks(FRONT.camera, FRONT.masks, FRONT.frames.indices)


def posed(first_row):
    """Poses of which the one that belongs to frame 0 has row ``first_row``."""

    def pose(rows):
        known = rows[(rows >= first_row) & (rows < first_row + 9)]
        return replace(BODIES.at(known - np.int32(first_row)), frame_indices=known)

    return pose


@pytest.mark.parametrize(("surplus", "shift"), [(0, 0), (1, 0), (1, 1), (3, 3), (-1, 0), (-1, -1)])
def test_the_end_that_fits_is_found(surplus, shift):
    aligned = align_poses("auto", surplus, SAMPLED, posed(shift))
    assert aligned.shift == shift
    assert aligned.overlaps[shift] == max(aligned.overlaps.values()) > 0.9
    assert f"(shift {shift:+d})" in aligned.remark
    assert "at -1" in aligned.remark
    assert "at +1" in aligned.remark


@pytest.mark.parametrize(("alignment", "shift"), [("start", 0), ("end", 1)])
def test_an_end_that_is_told_is_taken_and_its_overlap_measured(alignment, shift):
    aligned = align_poses(alignment, 1, SAMPLED, posed(0))
    assert aligned.shift == shift
    assert aligned.overlaps[0] > aligned.overlaps[1]


def test_a_body_that_stands_still_hardly_tells_the_ends_apart():
    still = replace(BODIES, vertices=np.repeat(BODIES.vertices[:1], 9, axis=0))

    def pose(rows):
        return replace(still.at(rows.clip(0, 8)), frame_indices=rows)

    assert "hardly tells them apart" in align_poses("auto", 1, SAMPLED, pose).remark
