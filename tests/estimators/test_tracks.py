"""People of an estimate: listed, chosen, and never mixed up with rows."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.tracks import Track, choose_track


def track(person, frames):
    frames = np.asarray(frames, np.int32)
    return Track(person, frames, {"frame": frames.astype(float)})


TRACKS = [track(1, range(5)), track(7, range(20)), track(3, range(9))]


def test_the_longest_track_is_taken_by_default_and_all_people_are_named():
    chosen, [remark] = choose_track(TRACKS, None)
    assert chosen.person == 7
    for words in ("person 1 (5 frames)", "person 3 (9 frames)", "person 7 is taken, the longest"):
        assert words in remark


def test_a_person_can_be_chosen():
    chosen, [remark] = choose_track(TRACKS, 3)
    assert chosen.person == 3
    assert "as chosen" in remark


def test_a_single_person_is_not_worth_a_word():
    assert choose_track(TRACKS[:1], None)[1] == ()


@pytest.mark.parametrize("tracks", [TRACKS, [track(None, [0, 1])]])
def test_an_unknown_person_is_refused_with_those_there_are(tracks):
    with pytest.raises(InputError, match=r"2, but it holds .*frames"):
        choose_track(tracks, 2)


def test_an_estimate_without_anybody_is_refused():
    with pytest.raises(InputError, match="nobody"):
        choose_track([], None)


def test_rows_follow_their_frames_whatever_their_order():
    chosen, _ = choose_track([track(1, [4, 0, 9, 2])], None)
    assert chosen.frame_indices.tolist() == [0, 2, 4, 9]
    assert chosen.arrays["frame"].tolist() == [0, 2, 4, 9]


def test_arrays_of_another_length_are_refused_by_name():
    wrong = Track(1, np.arange(3, dtype=np.int32), {"cam": np.zeros((4, 3))})
    with pytest.raises(InputError, match="cam must have 3 x 3 numbers"):
        wrong.floats("cam", 3)
    with pytest.raises(InputError, match="must hold verts"):
        wrong.bodies("verts")
