"""Masks and plates of videos that come with neither."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.datasets.aist_masks import (
    DifferenceMasks,
    PlateChoice,
    clip_plate,
    differs_from,
    masks_in_folder,
    person_near,
)
from mocoflow_core.datasets.aist_time import GridFrames
from mocoflow_core.datasets.body_regions import BodyRegion, BodyRegions
from mocoflow_core.errors import InputError
from mocoflow_core.io.video import write_video
from mocoflow_core.metrics.mask_iou import mask_iou
from tests.capsule_person import capsule_person
from tests.datasets.studio import CLOTHES, Y_UP, studio

PLATE = np.full((80, 80, 3), 120, np.uint8)
PERSON = np.zeros((80, 80), bool)
PERSON[10:60, 30:50] = True
SHADOW = np.zeros((80, 80), bool)
SHADOW[60:66, 30:76] = True


def region():
    small, large = np.ones((5, 5), np.uint8), np.ones((21, 21), np.uint8)
    inside, near = cv2.erode(PERSON * np.uint8(1), small), cv2.dilate(PERSON * np.uint8(1), large)
    return BodyRegion(inside > 0, PERSON, near > 0)


def scene(clothes=CLOTHES):
    frame = PLATE.copy()
    frame[SHADOW] = 70
    frame[PERSON] = clothes
    return frame


def test_a_shadow_is_part_of_the_plain_difference_but_not_near_a_body():
    plain = differs_from(PLATE, scene(), 30)
    assert mask_iou(plain, PERSON | SHADOW) > 0.99
    found = person_near(region(), PLATE, scene(), 30)
    # Right at the feet nobody can tell.
    assert (found & SHADOW).sum() < 0.3 * SHADOW.sum()
    assert (found[PERSON]).all()
    assert not found[:, 62:].any()


def test_clothes_like_the_wall_leave_no_hole_inside_a_body():
    frame = scene()
    frame[25:40, 35:45] = PLATE[0, 0]
    assert not differs_from(PLATE, frame, 30)[30, 40]
    assert person_near(region(), PLATE, frame, 30)[30, 40]


def test_dark_clothes_are_no_shadow():
    found = person_near(region(), PLATE, scene(clothes=(60, 60, 60)), 30)
    assert mask_iou(found, PERSON) > 0.85


def test_a_body_out_of_sight_gives_an_empty_mask():
    nothing = np.zeros((80, 80), bool)
    assert not person_near(BodyRegion(nothing, nothing, nothing), PLATE, scene(), 30).any()


class InMemory:
    """Frames by position."""

    def __init__(self, frames):
        self._frames = frames
        self.indices = np.arange(len(frames), dtype=np.int32)
        self.files, self.fps = [], 60.0

    def read(self, wanted):
        return ((number, self._frames[number]) for number in sorted(wanted))


@pytest.fixture(scope="module")
def on_the_spot():
    """Who stands still but for the arms."""
    swings = np.linspace(-0.5, 0.5, 6)
    return studio(("c01",), Y_UP, capsule_person([0.0] * 6, swings, [[0, 0, 0]] * 6))


def test_the_plate_is_taken_from_around_a_body_that_never_moves_away(on_the_spot):
    frames = InMemory(on_the_spot.frames("c01"))
    bodies = BodyRegions(on_the_spot.meshes, on_the_spot.cameras["c01"])
    choice, person = PlateChoice(6, 30), on_the_spot.masks["c01"].all(axis=0)
    plain, around = (
        clip_plate(frames, None, known, choice, frames.indices) for known in (None, bodies)
    )
    assert (np.abs(plain[person].astype(int) - CLOTHES) < 5).all()
    assert (np.abs(around[person].astype(int) - CLOTHES).max(axis=-1) > 30).mean() > 0.95
    masks = DifferenceMasks(frames, around, 30, bodies)
    for number, mask in masks.read([0, 5]):
        assert mask_iou(mask, on_the_spot.masks["c01"][number]) > 0.8


@pytest.mark.parametrize("given", ["nothing", "bodies", "masks"])
def test_held_out_frames_are_no_part_of_the_plate(on_the_spot, given):
    pictures = on_the_spot.frames("c01")
    pictures[1::2] = 255
    frames, learned = InMemory(pictures), np.arange(0, 6, 2, dtype=np.int32)
    bodies = BodyRegions(on_the_spot.meshes, on_the_spot.cameras["c01"])
    masks = InMemory(on_the_spot.masks["c01"])
    known = {"nothing": (None, None), "bodies": (None, bodies), "masks": (masks, None)}[given]
    plate = clip_plate(frames, *known, PlateChoice(6, 30), learned)
    beside = ~on_the_spot.masks["c01"].any(axis=0)
    assert plate[beside].max() < 200


def test_masks_of_a_folder_count_the_videos_frames_not_the_grids(tmp_path):
    write_video(tmp_path / "v.mp4", [np.full((32, 32, 3), 9 * n, np.uint8) for n in range(6)], 30)
    for number in (0, 1, 2):
        mask = np.zeros((32, 32), np.uint8)
        mask[number] = 255
        (tmp_path / "v").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / f"v/{number:06d}.png"), mask)
    frames = GridFrames(tmp_path / "v.mp4", np.arange(1, 8, dtype=np.int32))
    masks = masks_in_folder(tmp_path / "v", frames)
    assert masks.indices.tolist() == [1, 2, 3, 4, 5]
    rows = {tick: int(mask.any(axis=1).argmax()) for tick, mask in masks.read([1, 3, 4, 5])}
    assert rows == frames.shown([1, 3, 4, 5]) == {1: 0, 3: 1, 4: 2, 5: 2}


def test_masks_in_0_and_1_are_refused_with_the_reason(tmp_path):
    write_video(tmp_path / "v.mp4", [np.zeros((32, 32, 3), np.uint8)], 60)
    (tmp_path / "v").mkdir()
    cv2.imwrite(str(tmp_path / "v/000000.png"), np.eye(32, dtype=np.uint8))
    frames = GridFrames(tmp_path / "v.mp4", np.arange(1, dtype=np.int32))
    with pytest.raises(InputError, match="above 127"):
        list(masks_in_folder(tmp_path / "v", frames).read([0]))
