"""One person followed through a clip: where, in which pose, and for how long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import FrameSource, Image
from mocoflow_core.errors import InputError
from mocoflow_core.perception.blazepose import PRESENT, BlazePose
from mocoflow_core.perception.blazepose_detector import REGION_MARGIN, Detection
from mocoflow_core.perception.blazepose_landmarks import Pose
from mocoflow_core.perception.region import Region
from mocoflow_core.progress import Progress
from mocoflow_core.video.tracks import Track, choose_track, find_tracks, nobody

BATCH = 8
# A person that is missed for no longer is still there.
LONGEST_GAP_S = 0.35
# A person that is seen for a smaller share of the clip than this cannot be reconstructed from it.
LEAST_PRESENCE = 0.5


@dataclass(frozen=True, eq=False)
class FollowedPerson:
    """A person in every frame of a clip, from the first to the last."""

    poses: list[Pose]  # one a frame
    seen: NDArray[np.bool_]  # (T,) false where the pose is only the place between others
    first: int  # row of the clip in which it is first there
    remarks: tuple[str, ...]

    @property
    def last(self) -> int:
        return self.first + len(self.poses) - 1


def follow_person(
    frames: FrameSource,
    rate: float,
    start_s: float,
    person: int | None,
    model: BlazePose,
    progress: Progress,
) -> FollowedPerson:
    """Detect everybody, choose one, and find its pose in every frame in which it is there.

    ``start_s`` is where the clip begins in its video.

    Raises InputError as ``choose_track`` does, and for somebody who leaves for half of the clip.
    """
    count = len(frames.indices)
    found: list[list[Detection]] = []
    for pictures in _batches(frames):
        found += model.detector.detect(pictures, [Region.of_picture(p) for p in pictures])
        progress(0.25 * len(found) / count, "finding persons")
    track, said = choose_track(find_tracks(found), count, person)
    regions = regions_between(track, count)
    poses: list[Pose] = []
    for pictures in _batches(frames):
        poses += model.landmarks.poses(pictures, regions[len(poses) : len(poses) + len(pictures)])
        progress(0.25 + 0.75 * len(poses) / count, "following the person")
    present = np.array([pose.presence >= PRESENT for pose in poses])
    first, last = longest_stay(present, round(LONGEST_GAP_S * rate))
    remarks = (said, *_stay(present, first, last, rate, start_s))
    return FollowedPerson(poses[first : last + 1], present[first : last + 1], first, remarks)


def regions_between(track: Track, count: int) -> list[Region]:
    """A region for each frame, between the detections where there is none."""
    rows = sorted(track.detections)
    circles = [track.detections[row].circle.widened(REGION_MARGIN) for row in rows]
    known = np.array([(*circle.centre, circle.side, circle.angle) for circle in circles])
    known[:, 3] = np.unwrap(known[:, 3])
    columns = [np.interp(np.arange(count), rows, column) for column in known.T]
    rows_of_four = np.column_stack(columns).tolist()
    return [Region((x, y), side, angle) for x, y, side, angle in rows_of_four]


def longest_stay(present: NDArray[np.bool_], longest_gap: int) -> tuple[int, int]:
    """First and last row of the longest stay, gaps bridged. (0, -1) where there is none."""
    rows = np.flatnonzero(present)
    if not len(rows):
        return 0, -1
    stays = np.split(rows, np.flatnonzero(np.diff(rows) > longest_gap + 1) + 1)
    longest = max(stays, key=lambda stay: stay[-1] - stay[0])
    return int(longest[0]), int(longest[-1])


def _stay(
    present: NDArray[np.bool_], first: int, last: int, rate: float, start_s: float
) -> Iterator[str]:
    """What to say of frames without the person. Raises InputError where they are most."""
    if last < first:
        raise nobody()
    start, end = start_s + first / rate, start_s + last / rate
    part = f"{start:.1f} to {end:.1f} s of the video"
    if last - first + 1 < LEAST_PRESENCE * len(present):
        raise InputError(
            "a person who stays in the picture",
            f"one who is there from {part}, in {last - first + 1} of {len(present)} frames",
            f"Choose that part: --clip {start:.1f}-{end:.1f}.",
        )
    if last - first + 1 < len(present):
        yield f"caution: the person is in the picture from {part}, which is taken alone"
    missed = int((~present[first : last + 1]).sum())
    if missed:
        yield f"caution: {missed} frames between others do not show the person clearly"


def _batches(frames: FrameSource) -> Iterator[Sequence[Image]]:
    pictures: list[Image] = []
    for _, picture in frames.read(frames.indices.tolist()):
        pictures.append(picture)
        if len(pictures) == BATCH:
            yield pictures
            pictures = []
    if pictures:
        yield pictures
