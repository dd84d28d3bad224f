"""Laws of who is followed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.perception.blazepose_detector import Detection
from mocoflow_core.video.followed_person import follow_person, longest_stay, regions_between
from mocoflow_core.video.tracks import choose_track, find_tracks

FRAMES = 30


def person(x, side, y=300.0):
    """Upright, the hips at (x, y)."""
    points = np.float32([(x, y), (x, y - side / 2), (x, y), (x, y)])
    return Detection(np.zeros(4, np.float32), points, 0.9)


def walking(start, end, side, frames=FRAMES):
    return [person(x, side) for x in np.linspace(start, end, frames)]


def beside(*persons):
    """Detections of every frame, in an order that says nothing."""
    return [
        list(found if row % 2 else found[::-1])
        for row, found in enumerate(zip(*persons, strict=True))
    ]


def test_persons_are_told_apart_by_overlap_over_time():
    tracks = find_tracks(beside(walking(300, 500, 200), walking(700, 900, 300)))
    assert [len(track.detections) for track in tracks] == [FRAMES, FRAMES]
    assert [track.side_px for track in tracks] == pytest.approx([300, 200])
    track, said = choose_track(tracks, FRAMES, None)
    assert track is tracks[0]
    assert "2 persons, the largest is followed" in said


def test_a_missed_frame_does_not_end_a_track():
    found = [[one] for one in walking(300, 400, 200)]
    found[10] = found[11] = []
    (track,) = find_tracks(found)
    assert len(track.detections) == FRAMES - 2
    regions = regions_between(track, FRAMES)
    assert len(regions) == FRAMES
    assert regions[10].centre[0] == pytest.approx(np.linspace(300, 400, FRAMES)[10], abs=0.1)


def test_a_passer_by_is_nobody():
    found = [[one] for one in walking(300, 400, 200)]
    found[5].append(person(900, 250))
    assert len(find_tracks(found)) == 1


def test_two_of_a_size_are_listed_and_must_be_chosen_from():
    tracks = find_tracks(beside(walking(200, 250, 210), walking(700, 700, 200)))
    with pytest.raises(InputError) as refused:
        choose_track(tracks, FRAMES, None)
    assert "2 of a size" in str(refused.value)
    assert "--person 1: 200 px around (700, 300), 30 of 30 frames" in str(refused.value)
    assert choose_track(tracks, FRAMES, 1)[0] is tracks[1]
    with pytest.raises(InputError, match="--person from 0 to 1, got 2"):
        choose_track(tracks, FRAMES, 2)


def test_nobody_is_refused():
    with pytest.raises(InputError, match="nobody in the video"):
        choose_track(find_tracks([[] for _ in range(FRAMES)]), FRAMES, None)


@pytest.mark.parametrize(
    ("present", "stay"),
    [
        ("111111", (0, 5)),
        ("110111", (0, 5)),
        ("110011", (0, 1)),
        ("100111", (3, 5)),
        ("011100", (1, 3)),
        ("000000", (0, -1)),
    ],
)
def test_the_longest_stay_bridges_one_missed_frame(present, stay):
    assert longest_stay(np.array([letter == "1" for letter in present]), 1) == stay


class Nowhere:
    """Finds a circle in every frame, and no person in it."""

    def detect(self, pictures, regions):
        return [[person(300, 200)] for _ in pictures]

    def poses(self, pictures, regions):
        return [SimpleNamespace(presence=0.1) for _ in pictures]

    detector = landmarks = property(lambda self: self)


class Staying(Nowhere):
    """There in the frames 4 to 9 of ten a second."""

    def __init__(self):
        self.asked = -1

    def poses(self, pictures, regions):
        found = []
        for _ in pictures:
            self.asked += 1
            found.append(SimpleNamespace(presence=float(4 <= self.asked < 10)))
        return found


class Blank:
    indices = np.arange(FRAMES)

    def read(self, wanted):
        return ((number, np.zeros((8, 8, 3), np.uint8)) for number in wanted)


def followed(model):
    return follow_person(Blank(), 10.0, 5.0, None, model, lambda fraction, text: None)


def test_circles_without_a_pose_are_nobody():
    with pytest.raises(InputError, match="nobody in the video"):
        followed(Nowhere())


def test_somebody_who_leaves_is_named_with_the_part_of_the_video_to_choose():
    with pytest.raises(InputError, match=r"5\.4 to 5\.9 s .* --clip 5\.4-5\.9"):
        followed(Staying())
