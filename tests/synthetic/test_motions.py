from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.catalogue import SCENES
from mocoflow_core.synthetic.motions import MOTIONS
from mocoflow_core.synthetic.scene_writer import perform


def _headings(motion):
    looks = motion.root_rotation.apply([0.0, -1.0, 0.0])
    return np.unwrap(np.arctan2(looks[:, 1], looks[:, 0]))


def test_the_turn_goes_all_the_way_round_without_repeating_its_first_frame():
    headings = np.degrees(_headings(MOTIONS["turn"](np.linspace(0, 1, 48))))
    steps = np.diff(headings)
    assert steps == pytest.approx(np.full(47, 360 / 48))


def test_the_spin_turns_at_least_twenty_degrees_between_frames():
    steps = np.diff(np.degrees(_headings(MOTIONS["fast_spin"](np.linspace(0, 1, 48)))))
    assert steps.min() > 20


def test_the_walker_looks_where_it_goes():
    motion = MOTIONS["walk_circle"](np.linspace(0, 1, 48))
    step = np.diff(motion.root_position, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    looks = motion.root_rotation.apply([0.0, -1.0, 0.0])[:-1]
    assert (step * looks).sum(axis=1).min() > np.cos(np.radians(8))


def test_standing_still_is_still(person):
    motion = MOTIONS["still"](np.linspace(0, 1, 3))
    posed = person.pose(motion)
    assert np.abs(posed - posed[:1]).max() == 0


@pytest.mark.parametrize("name", ["turn", "walk", "dance", "spin", "still"])
def test_the_person_stands_on_the_floor_and_fills_seventy_per_cent_of_the_train_image(name, person):
    configuration = SCENES[name].model_copy(update={"frames": 12})
    _, performance = perform(configuration, person)
    assert performance.vertices[..., 2].min(axis=1) == pytest.approx(np.zeros(12), abs=1e-9)
    cameras = camera_ring(configuration, performance.vertices)
    for camera in cameras:
        pixels = camera.project(performance.vertices)
        assert pixels.min() > 0
        assert pixels.max() < 128
    extent = np.ptp(cameras[0].project(performance.vertices)[..., 1], axis=1)
    assert extent.min() > 0.7 * 128
