"""The persons of a video: detections that overlap from frame to frame, and which one is meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.perception.blazepose_detector import Detection
from mocoflow_core.perception.overlap import overlaps
from mocoflow_core.perception.region import Region

SAME_PERSON_OVERLAP = 0.3
# Persons in fewer frames than this share are passers-by or mistakes.
LEAST_SHARE = 0.1
# A second person is as large as the first from this ratio on, and present as long.
AS_LARGE = 0.75
AS_LONG = 0.5


@dataclass
class Track:
    """One person over time."""

    detections: dict[int, Detection] = field(default_factory=dict)  # by row of the clip

    @property
    def last(self) -> Region:
        return self.detections[max(self.detections)].circle

    @property
    def side_px(self) -> float:
        """Median side of the square about the person."""
        return float(np.median([found.circle.side for found in self.detections.values()]))

    def describe(self, frames: int) -> str:
        """Where and how large, for somebody who has to choose."""
        centres = [found.circle.centre for found in self.detections.values()]
        x, y = np.median(centres, axis=0)
        return (
            f"{self.side_px:.0f} px around ({x:.0f}, {y:.0f}), "
            f"{len(self.detections)} of {frames} frames"
        )


def find_tracks(found: Sequence[Sequence[Detection]]) -> list[Track]:
    """Persons by size times presence, the largest first; ``found`` has a list for each frame."""
    tracks: list[Track] = []
    for row, detections in enumerate(found):
        free = list(tracks)
        for detection in detections:
            lasts = np.array([track.last.corners for track in free]).reshape(-1, 4)
            shares = overlaps(detection.circle.corners, lasts)
            if len(free) and shares.max() >= SAME_PERSON_OVERLAP:
                track = free.pop(int(shares.argmax()))
            else:
                track = Track()
                tracks.append(track)
            track.detections[row] = detection
    lasting = [track for track in tracks if len(track.detections) >= LEAST_SHARE * len(found)]
    return sorted(lasting, key=lambda track: -track.side_px * len(track.detections))


def choose_track(tracks: Sequence[Track], frames: int, person: int | None) -> tuple[Track, str]:
    """The person that is meant, and a remark where there are several.

    Raises InputError where nobody is, for a number that nobody has, and where two are as large and
    none is named.
    """
    if not tracks:
        raise nobody()
    listed = "; ".join(
        f"--person {number}: {track.describe(frames)}" for number, track in enumerate(tracks)
    )
    if person is not None:
        if person >= len(tracks):
            raise InputError(
                f"--person from 0 to {len(tracks) - 1}", f"{person}", f"There are {listed}."
            )
        return tracks[person], f"person {person} of {len(tracks)} is followed"
    first = tracks[0]
    rivals = [
        track
        for track in tracks[1:]
        if track.side_px >= AS_LARGE * first.side_px
        and len(track.detections) >= AS_LONG * len(first.detections)
    ]
    if rivals:
        raise InputError(
            "one person who is the largest",
            f"{1 + len(rivals)} of a size",
            f"Choose one: {listed}.",
        )
    if len(tracks) == 1:
        return first, f"one person: {first.describe(frames)}"
    return first, f"{len(tracks)} persons, the largest is followed; {listed}"


def nobody() -> InputError:
    return InputError(
        "a person who can be seen",
        "nobody in the video",
        "Film the whole person, upright, from 2 to 5 metres.",
    )
