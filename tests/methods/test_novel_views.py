"""Which moments of a clip are rendered."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.capture.frame_selection import select_frames
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.methods.novel_views import ViewRequest, _moments
from mocoflow_core.methods.run_clip import RunClip


def run_of(first: int, last: int, source_fps: float, fps: float) -> RunRecord:
    rates = {"fps": fps, "source_fps": source_fps}
    capture = {**rates, "first_frame": first, "last_frame": last, "up": [0, 0, 1]}
    said = {"request": "", "scene": "turn", "scene_path": "", "preset": "toy", "store": ""}
    return RunRecord(**said, seed=0, configuration={}, capture=capture)


@pytest.mark.parametrize("working_fps", [30.0, 24.0, 15.0, 12.0, 7.0])
def test_without_a_choice_every_working_frame_is_rendered(working_fps):
    none = np.empty(0, np.int32)
    filmed = np.arange(3, 64, dtype=np.int32)
    selected = select_frames(filmed, 30.0, working_fps, none, 0, 0)
    first, last = (int(selected.working[row]) for row in (0, -1))
    run = run_of(first, last, 30.0, selected.fps)
    frames = [frame for frame, _ in _moments(RunClip.of(run), ViewRequest(camera="orbit"))]
    assert frames == selected.working.tolist()
