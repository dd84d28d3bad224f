from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.person_judge import PersonJudge, PersonScoreConfig, open_networks
from mocoflow_core.perception.nanodet import NanoDet
from tests.dark_person import DarkPerson

CONFIGURATION = PersonScoreConfig()


@pytest.fixture
def judge() -> PersonJudge:
    return PersonJudge(CONFIGURATION, DarkPerson(), DarkPerson())


def block(left: int, width: int = 20) -> np.ndarray:
    image = np.full((60, 60, 3), 255, np.uint8)
    image[10:50, left : left + width] = 0
    return image


WHITE = np.full((60, 60, 3), 255, np.uint8)


def test_a_moved_person_is_like_the_photograph_and_a_missing_one_scores_zero(judge):
    reference, moved, missing = judge.look([block(10), block(25), WHITE])
    assert judge.similarity(moved, reference, 800.0) == pytest.approx(1.0, abs=1e-6)
    assert judge.similarity(missing, reference, 800.0) == 0.0
    assert (moved.person, missing.person) == (True, False)


def test_a_photograph_without_a_person_is_no_reference(judge):
    missing, found = judge.look([WHITE, block(10)])
    assert not judge.has_reference(missing)
    assert judge.has_reference(found)
    assert np.isnan(judge.similarity(found, missing, 800.0))


def test_a_pose_is_in_pixels_of_the_picture_and_not_of_the_border_around_it(judge):
    (sight,) = judge.look([block(5, width=25)])
    box = sight.pose.places.min(axis=0), sight.pose.places.max(axis=0)
    assert np.allclose(box, [[5, 10], [30, 50]])


def test_half_a_pixel_is_all_that_is_wrong_with_a_shifted_photograph(judge):
    (reference,), (shifted,) = judge.look([block(10)]), judge.look_shifted([block(10)])
    assert judge.similarity(shifted, reference, 800.0) > 0.97


def test_every_number_says_which_networks_gave_it(judge):
    assert "dark pixels 000000000000" in judge.plausibility_protocol()
    assert "0.5" in judge.plausibility_protocol()
    assert "dark pixels 000000000000" in judge.oks_protocol()


def test_a_network_sees_no_person_in_white_or_noise():
    noise = np.random.default_rng(0).integers(0, 256, (120, 120, 3), dtype=np.uint8)
    white, noisy = NanoDet().boxes([WHITE, noise])
    assert max([*white.confidence, *noisy.confidence], default=0.0) < CONFIGURATION.confidence


def test_networks_switched_off_are_not_loaded_and_need_no_reason():
    assert open_networks(PersonScoreConfig(use="off")) == ""
