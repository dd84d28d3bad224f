"""Laws of the person before another background: the person stays, shadows do not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.composite import RIM_PX, composite_clip
from mocoflow_core.capture.extract import CaptureConfig, extract_clip, extract_evaluation
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.capture.shadows import shadow, shadowed_area
from tests.capsule_person import default_recipe, room, write_scene

FRAMES = 12
DIMMED = 0.6


@pytest.fixture
def scene(tmp_path) -> Scene:
    """A person whose shadow falls beside it and moves with it; no plate is given."""
    folder = write_scene(tmp_path, replace(default_recipe(FRAMES), background=False))
    for camera in ("cam00", "cam01"):
        for path in (folder / "frames" / camera).iterdir():
            frame = cv2.imread(str(path))
            mask = cv2.imread(str(folder / "masks" / camera / path.name), 0) > 127
            darker = np.roll(mask, (20, 14), axis=(0, 1)) & ~mask
            frame[darker] = (DIMMED * frame[darker]).astype(np.uint8)
            cv2.imwrite(str(path), frame)
    return open_scene(folder)


def composited(scene: Scene, behind, max_side: int = 512) -> tuple[Clip, Clip]:
    """The clip as seen and with what is behind the person replaced."""
    seen = extract_clip(scene, CaptureConfig(max_side=max_side))
    return seen, composite_clip(scene, seen, behind, scene.masks("cam00"))


def beyond(masks, behind):
    """Pixels that belong to the background alone: before the plate all but a rim."""
    if behind == "white":
        return ~masks
    rim = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
    return np.stack([cv2.dilate(mask.astype(np.uint8), rim) == 0 for mask in masks])


def test_half_covered_pixels_stay_before_the_plate_and_go_before_white(scene):
    seen, plate = composited(scene, "plate")
    rim = ~seen.masks & ~beyond(seen.masks, "plate")
    assert np.array_equal(plate.frames[rim], seen.frames[rim])
    _, white = composited(scene, "white")
    assert (white.frames[rim] == 255).all()


def test_kept_is_the_clip_itself(scene):
    seen, kept = composited(scene, "kept")
    assert kept is seen


@pytest.mark.parametrize("behind", ["plate", "white"])
@pytest.mark.parametrize("from_files", [True, False])
def test_the_person_stays_and_everything_else_is_the_background(scene, behind, from_files):
    seen = extract_clip(scene, CaptureConfig())
    clip = composite_clip(scene, seen, behind, scene.masks("cam00") if from_files else {})
    expected = seen.background if behind == "plate" else np.full_like(seen.background, 255)
    assert np.array_equal(clip.background, expected)
    assert np.array_equal(clip.frames[clip.masks], seen.frames[seen.masks])
    outside = beyond(clip.masks, behind)
    everywhere = np.broadcast_to(expected, clip.frames.shape)
    assert np.array_equal(clip.frames[outside], everywhere[outside])


def test_working_pixels_on_the_edge_mix_by_the_area_of_the_person(scene):
    _, clip = composited(scene, "white", max_side=32)
    _, full = composited(scene, "white")
    small = [cv2.resize(frame, (21, 32), interpolation=cv2.INTER_AREA) for frame in full.frames]
    assert np.abs(clip.frames.astype(int) - np.stack(small)).max() <= 2


def test_a_moving_shadow_disappears(scene):
    seen, clip = composited(scene, "plate")
    assert shadowed_area(seen) > 0.3
    assert shadowed_area(clip) == 0
    # The median never shows the shadow where it does not stay.
    free = ~seen.masks.all(axis=0)
    assert (np.abs(clip.background.astype(int) - room(64, 96, 0))[free] <= 2).mean() > 0.95


def test_a_shadow_is_darker_and_of_the_colour_of_the_plate():
    plate = np.full((30, 30, 3), (180, 140, 90), np.uint8)
    nobody = np.zeros((30, 30), bool)
    frame = plate.copy()
    frame[5:15, 5:15] = (0.7 * plate[5:15, 5:15]).astype(np.uint8)
    frame[18:26, 18:26] = (90, 20, 90)
    found = shadow(frame, nobody, plate)
    assert found[5:15, 5:15].all()
    assert found.sum() == 100
    assert not shadow(plate, nobody, frame).any()


@pytest.mark.parametrize("behind", ["plate", "white"])
def test_evaluation_cameras_are_treated_as_the_train_camera(scene, behind):
    wanted = np.arange(FRAMES, dtype=np.int32)
    [seen] = extract_evaluation(scene, wanted, CaptureConfig())
    [clip] = extract_evaluation(scene, wanted, CaptureConfig(behind_person=behind))
    assert np.array_equal(clip.frames[clip.masks], seen.frames[seen.masks])
    outside = beyond(clip.masks, behind)
    everywhere = np.broadcast_to(clip.background, clip.frames.shape)
    assert np.array_equal(clip.frames[outside], everywhere[outside])


def test_a_frame_with_an_unknown_mask_stays_before_the_plate_and_is_left_out_before_white(scene):
    seen = extract_clip(scene, CaptureConfig())
    seen = replace(seen, has_mask=np.arange(FRAMES) != 4)
    plate = composite_clip(scene, seen, "plate", scene.masks("cam00"))
    assert np.array_equal(plate.frames[4], seen.frames[4])
    assert "frame 4 without a mask" in plate.remarks[-1]
    white = composite_clip(scene, seen, "white", scene.masks("cam00"))
    assert 4 not in white.frame_indices
    assert (white.frames[~white.masks] == 255).all()
    assert "frame 4 left out" in white.remarks[-1]
