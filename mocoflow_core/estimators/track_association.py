"""People of single frames, in any order, joined to tracks by where they are in the picture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Array = NDArray[np.float64]

# Nobody crosses more of the picture than this from one frame to the next; a second person that
# appears elsewhere is another track. Those who are away longer come back as somebody else.
LARGEST_STEP = 0.15
LONGEST_ABSENCE = 30  # frames


def follow_people(places: Mapping[int, Array]) -> dict[int, NDArray[np.int64]]:
    """The person (N,) behind each detection of each frame, numbered from 0 as they appear.

    Args:
        places: by frame number, (N, D): where people are and how large, in units of the picture's
            side. In each frame the whole assignment is the shortest one.
    """
    last: dict[int, tuple[int, Array]] = {}
    found: dict[int, NDArray[np.int64]] = {}
    known = 0
    for frame in sorted(places):
        here = np.asarray(places[frame], np.float64)
        alive = [person for person, (seen, _) in last.items() if frame - seen <= LONGEST_ABSENCE]
        who = np.full(len(here), -1, np.int64)
        if alive and len(here):
            before = np.stack([last[person][1] for person in alive])
            steps = np.linalg.norm(here[:, None] - before[None], axis=-1)
            waited = np.array([frame - last[person][0] for person in alive])
            allowed = LARGEST_STEP * waited.clip(1)
            for row, column in zip(*linear_sum_assignment(np.minimum(steps, allowed)), strict=True):
                if steps[row, column] < allowed[column]:
                    who[row] = alive[column]
        for row in np.flatnonzero(who < 0):
            who[row] = known
            known += 1
        last |= {int(person): (frame, place) for person, place in zip(who, here, strict=True)}
        found[frame] = who
    return found
