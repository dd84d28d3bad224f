from __future__ import annotations

import time

import pytest

from mocoflow_core.io.work_clock import WorkClock


def test_what_is_left_out_does_not_count_and_stays_out_after_a_kill(tmp_path):
    clock = WorkClock(tmp_path / "stage.seconds")
    time.sleep(0.05)
    before = clock.wall_s
    clock.leave_out(0.02, 0.0)
    clock.leave_out(0.01, 0.0)
    # The two looks are microseconds apart.
    assert clock.wall_s == pytest.approx(before - 0.03, abs=0.005)
    clock.note()
    noted = clock.wall_s
    again = WorkClock(tmp_path / "stage.seconds")
    assert again.wall_s == pytest.approx(noted, abs=0.005)


def test_a_clock_that_was_put_back_makes_no_cost_negative(tmp_path):
    clock = WorkClock(tmp_path / "stage.seconds")
    clock.leave_out(1000.0, 1000.0)
    assert (clock.wall_s, clock.cpu_s) == (0.0, 0.0)


def test_a_note_that_was_lost_with_the_power_counts_nothing(tmp_path):
    (tmp_path / "stage.seconds").write_bytes(b"")
    assert WorkClock(tmp_path / "stage.seconds").wall_s < 1.0
