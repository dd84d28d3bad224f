"""Laws of masks: the network where it is sure, the plate between."""

from __future__ import annotations

import cv2
import numpy as np

from mocoflow_core.video.person_masks import PackedMasks, neighbours, refine

SIZE = 200


def scene():
    """A picture, its plate, and where the person really is: a body with a gap, and a hand."""
    plate = np.random.default_rng(0).integers(90, 110, (SIZE, SIZE, 3)).astype(np.uint8)
    truth = np.zeros((SIZE, SIZE), np.uint8)
    cv2.rectangle(truth, (60, 40), (140, 170), 1, -1)
    cv2.rectangle(truth, (90, 100), (110, 169), 0, -1)
    cv2.rectangle(truth, (141, 60), (160, 66), 1, -1)
    picture = np.where(truth[..., None] > 0, np.uint8([200, 60, 40]), plate)
    return picture, plate, truth > 0


def blurred(truth):
    """What a coarse network says."""
    return cv2.GaussianBlur(truth.astype(np.float32), (0, 0), 6)


def share(first, second):
    return (first & second).sum() / (first | second).sum()


def test_edges_are_those_of_the_picture():
    picture, plate, truth = scene()
    coarse = blurred(truth)
    mask = refine(coarse, picture, plate, 30)
    assert share(coarse > 0.5, truth) < 0.965 < 0.985 < share(mask, truth)


def test_a_person_of_the_walls_colour_stays_where_the_network_is_sure():
    _, plate, truth = scene()
    mask = refine(np.where(truth, np.float32(0.95), np.float32(0.02)), plate, plate, 30)
    assert share(mask, truth) > 0.97


def test_what_moves_elsewhere_is_not_the_person():
    picture, plate, truth = scene()
    picture[10:30, 10:30] = 255
    doubt = blurred(truth)
    doubt[10:20, 10:20] = 0.3
    mask = refine(doubt, picture, plate, 30)
    assert not mask[:32, :32].any()


def test_pinholes_are_filled_and_gaps_are_kept():
    picture, plate, truth = scene()
    picture[60:63, 80:83] = plate[60:63, 80:83]
    sure = np.where(truth, np.float32(0.6), np.float32(0.02))
    mask = refine(sure, picture, plate, 30)
    assert mask[58:65, 78:85].all()
    assert not mask[110:160, 95:105].any()


def test_packed_masks_come_back_by_number():
    masks = np.random.default_rng(0).uniform(size=(3, 7, 11)) > 0.5
    packed = PackedMasks(np.int32([4, 6, 9]), [np.packbits(mask) for mask in masks], (7, 11))
    read = dict(packed.read([9, 4]))
    assert list(read) == [4, 9]
    assert np.array_equal(read[9], masks[2])


def test_a_mask_is_steadied_by_no_frame_that_may_be_held_out():
    every_second = np.arange(7) % 2 == 0
    assert neighbours(2, every_second, reach=1) == []
    assert neighbours(2, every_second, reach=2) == [0, 4]
    assert neighbours(3, every_second, reach=1) == [2, 4]
    assert neighbours(0, every_second, reach=9) == neighbours(6, every_second, reach=9) == []
