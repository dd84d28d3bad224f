import numpy as np
import pytest

from mocoflow_core.body.fit.fittable_body import LANDMARKS
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.errors import InputError


def test_blazepose_landmarks_come_in_the_order_of_ours():
    places = np.stack([np.arange(33.0), np.zeros(33)], -1)[None]
    sightings = Sightings.of(places, np.ones((1, 33)))
    number = dict(zip(LANDMARKS, sightings.places[0, :, 0], strict=True))
    assert (number["left_shoulder"], number["right_hip"], number["left_toes"]) == (11, 24, 31)


def test_coco_has_no_feet():
    sightings = Sightings.of(np.zeros((2, 17, 2)), np.ones((2, 17)))
    assert (sightings.confidence[:, :17] == 1).all()
    assert (sightings.confidence[:, 17:] == 0).all()


def test_what_is_not_finite_is_unseen():
    places = np.zeros((1, 17, 2))
    places[0, 3] = np.nan
    sightings = Sightings.of(places, np.ones((1, 17)))
    assert sightings.confidence[0, 3] == 0
    assert np.isfinite(sightings.places).all()


@pytest.mark.parametrize(
    ("places", "confidence", "world"),
    [((2, 18, 2), (2, 18), None), ((2, 17, 2), (3, 17), None), ((2, 17, 2), (2, 17), (2, 16, 3))],
)
def test_other_sizes_are_refused(places, confidence, world):
    with pytest.raises(InputError, match="landmarks"):
        Sightings.of(
            np.zeros(places), np.ones(confidence), None if world is None else np.zeros(world)
        )


def test_a_clip_without_anybody_is_refused():
    with pytest.raises(InputError, match="person"):
        Sightings.of(np.zeros((3, 17, 2)), np.zeros((3, 17)))
