from __future__ import annotations

import numpy as np

from mocoflow_core.estimators.track_association import LONGEST_ABSENCE, follow_people


def crossing(frames=20):
    """Two people who walk past each other, of different size, listed in changing order."""
    places, truth = {}, {}
    for frame in range(frames):
        share = frame / (frames - 1)
        people = np.array([[0.3, -0.4 + 0.8 * share, 0.0], [0.5, 0.4 - 0.8 * share, 0.02]])
        order = [0, 1] if frame % 3 else [1, 0]
        places[frame], truth[frame] = people[order], order
    return places, truth


def test_people_keep_their_number_while_they_cross_in_any_order():
    places, truth = crossing()
    found = follow_people(places)
    first = dict(zip(truth[0], found[0].tolist(), strict=True))
    for frame, order in truth.items():
        assert found[frame].tolist() == [first[person] for person in order]


def test_a_frame_without_them_does_not_end_their_tracks():
    places, _ = crossing()
    places.pop(10)
    assert {int(who) for row in follow_people(places).values() for who in row} == {0, 1}


def test_somebody_elsewhere_is_somebody_else():
    found = follow_people({0: np.array([[0.3, 0, 0]]), 1: np.array([[0.3, 0.5, 0]])})
    assert found[0].tolist() != found[1].tolist()


def test_who_was_away_too_long_comes_back_as_somebody_else():
    place = np.array([[0.3, 0.0, 0.0]])
    found = follow_people({0: place, 1 + LONGEST_ABSENCE: place})
    assert found[1 + LONGEST_ABSENCE].tolist() == [1]
