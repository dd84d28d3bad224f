"""Which frames of a ZJU-MoCap subject make the clip."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.datasets.zju_clips import bad_masks, chosen_range, subject_of, unbroken_clip
from mocoflow_core.errors import InputError


@pytest.mark.parametrize(
    ("subject", "frames"),
    [("377", "0 to 299"), ("313", "1 to 60"), ("315", "1 to 400"), ("390", "700 to 999"),
     ("396", "810 to 1349"), (None, "0 to 299")],
)  # fmt: skip
def test_each_subject_has_the_clip_that_is_usual_for_it(subject, frames):
    assert str(chosen_range(subject, None, None)) == frames


def test_a_clip_can_be_chosen():
    assert str(chosen_range("390", 0, 10)) == "0 to 9"
    assert str(chosen_range("390", None, 10)) == "700 to 709"


def test_the_subject_is_told_by_the_folder_or_else_by_the_pictures():
    assert subject_of(["CoreView_387", "CoreView_313_x.jpg"]) == "387"
    assert subject_of(["renamed", "CoreView_313_Camera_(1)_0001_x.jpg"]) == "313"
    assert subject_of(["renamed", "000000.jpg"]) is None


def test_the_longest_run_with_pictures_and_masks_is_used_and_said():
    pictures = np.arange(20, dtype=np.int32)
    masked = np.delete(pictures, [3, 12]).astype(np.int32)
    clip, remarks = unbroken_clip(chosen_range(None, 0, 20), pictures, masked)
    assert clip.tolist() == list(range(4, 12))
    assert "4 to 11" in remarks[0]
    assert "2 pictures lack their mask" in remarks[0]


def test_a_complete_clip_needs_no_remark():
    numbers = np.arange(20, dtype=np.int32)
    clip, remarks = unbroken_clip(chosen_range(None, 5, 10), numbers, numbers)
    assert (clip.tolist(), remarks) == (list(range(5, 15)), ())


def test_a_range_without_frames_tells_which_there_are():
    numbers = np.arange(20, dtype=np.int32)
    with pytest.raises(InputError, match="pictures 0 to 19"):
        unbroken_clip(chosen_range("390", None, None), numbers, numbers)


def test_masks_known_to_be_wrong_are_told():
    assert bad_masks("387", np.arange(300, 400)) != ()
    assert bad_masks("387", np.arange(0, 300)) == ()
    assert bad_masks("377", np.arange(300, 400)) == ()
