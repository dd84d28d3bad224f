"""Which frames of a People-Snapshot video are used."""

from __future__ import annotations

import pytest

from mocoflow_core.datasets.snapshot_clips import choose_clip
from mocoflow_core.errors import InputError


@pytest.mark.parametrize(
    ("subject", "first", "count"),
    [("female-3-casual", 0, 230), ("female-4-casual", 10, 200), ("male-5-outdoor", 0, 295)],
)
def test_known_subjects_have_their_usual_clip(subject, first, count):
    numbers, words = choose_clip(subject, None, None, 600)
    assert numbers.tolist() == list(range(first, first + count))
    assert f"frames {first} to {first + count - 1}" in words


def test_other_subjects_are_used_whole():
    numbers, words = choose_clip("female-9-sport", None, None, 40)
    assert numbers.tolist() == list(range(40))
    assert "all there are" in words


def test_a_video_that_is_shorter_than_the_usual_clip_is_used_whole_and_told():
    numbers, words = choose_clip("female-3-casual", None, None, 100)
    assert len(numbers) == 100
    assert "fewer than the usual clip 0 to 229" in words


def test_either_end_can_be_chosen():
    assert choose_clip("female-3-casual", 300, 20, 600)[0].tolist() == list(range(300, 320))
    assert choose_clip("female-3-casual", None, 20, 600)[0].tolist() == list(range(20))
    assert choose_clip("female-3-casual", 500, None, 600)[0].tolist() == list(range(500, 600))


@pytest.mark.parametrize(("first", "frames"), [(600, None), (590, 20), (None, 700)])
def test_a_choice_beyond_the_video_is_refused(first, frames):
    with pytest.raises(InputError, match="frames 0 to 599"):
        choose_clip("female-9-sport", first, frames, 600)
