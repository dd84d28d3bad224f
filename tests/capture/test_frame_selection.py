"""Laws of thinning out frames."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.capture.frame_selection import require_contiguous, select_frames
from mocoflow_core.errors import InputError


def select(count=100, source=60.0, working=12.0, scorable=None, held=8, every=0, first=0):
    available = np.arange(first, first + count, dtype=np.int32)
    return select_frames(
        available, source, working, available if scorable is None else scorable, held, every
    )


def test_working_frames_keep_their_source_numbers():
    assert select(first=40).working.tolist() == list(range(40, 140, 5))


def test_held_out_frames_lie_half_way_between_working_frames():
    selection = select()
    assert len(selection.held_out) == 8
    assert set(selection.held_out % 5) == {2}
    assert not set(selection.held_out) & set(selection.working)
    assert selection.held_out.min() > 0
    assert selection.held_out.max() < selection.working.max()


def test_held_out_frames_are_scorable_ones():
    scorable = np.arange(0, 50, dtype=np.int32)
    assert select(scorable=scorable).held_out.max() < 50


def test_the_source_rate_is_never_exceeded():
    selection = select(source=10.0, working=12.0)
    assert selection.fps == 10.0
    assert len(selection.working) == 100
    assert len(selection.held_out) == 0


def test_a_rate_a_little_off_a_multiple_keeps_an_even_step():
    selection = select(source=59.94)
    assert set(np.diff(selection.working)) == {5}
    assert selection.fps == pytest.approx(59.94 / 5)


@pytest.mark.parametrize("source", [30.0, 25.0, 50.0, 24.0])
def test_working_frames_follow_the_rate_to_half_a_frame(source):
    selection = select(source=source, count=500)
    ideal = np.arange(len(selection.working)) * source / 12
    assert np.abs(selection.working - ideal).max() <= 0.5
    assert np.all(np.diff(selection.working) > 0)
    assert selection.working.max() < 500


def test_without_frames_between_every_nth_working_frame_is_held_out_on_demand():
    assert len(select(source=12.0).held_out) == 0
    selection = select(source=12.0, every=8)
    assert set(np.diff(selection.held_out)) == {8}
    assert set(selection.held_out) <= set(selection.working)


def test_a_gap_is_refused_with_its_first_number():
    with pytest.raises(InputError, match="no frame 3 "):
        require_contiguous(np.array([0, 1, 2, 4, 5], np.int32), "frames of cam00")
