from __future__ import annotations

import pytest

from mocoflow_core.training.clock import Seconds, TrainingClock, snapshot_due
from tests.training.slow_clock import SlowClock


def test_seconds_of_two_tries_add_up():
    total = Seconds(1.0, 3.0) + Seconds(0.5, 0.25)
    assert (total.wall, total.cpu) == (1.5, 3.25)
    assert total.since(Seconds(0.5, 0.25)) == Seconds(1.0, 3.0)


def test_the_clock_counts_work_and_stands_still_in_a_pause():
    machine, pauses = SlowClock(), []
    clock = TrainingClock(lambda *seconds: pauses.append(seconds), machine)
    machine.spend(3.0)
    with clock.paused():
        machine.spend(10.0)
    machine.spend(2.0)
    assert clock.read() == Seconds(5.0, 10.0)
    assert pauses == [(10.0, 20.0)]


def test_a_pause_that_fails_is_still_no_work():
    machine = SlowClock()
    clock = TrainingClock(now=machine)
    with pytest.raises(ZeroDivisionError), clock.paused():
        machine.spend(10.0)
        raise ZeroDivisionError
    assert clock.read() == Seconds()


def test_a_resumed_clock_goes_on_and_counts_its_own_preparation():
    machine = SlowClock()
    clock = TrainingClock(now=machine)
    machine.spend(1.0)
    clock.go_on_from(Seconds(7.0, 9.0))
    with clock.paused():
        machine.spend(0.25)
    assert clock.read() == Seconds(8.0, 11.0)


def test_a_clock_that_is_put_back_loses_the_jump_and_nothing_else():
    machine, pauses = SlowClock(), []
    clock = TrainingClock(lambda *seconds: pauses.append(seconds), machine)
    machine.spend(3.0)
    assert clock.read() == Seconds(3.0, 6.0)
    machine.spend(-500.0)
    assert clock.read() == Seconds(3.0, 6.0)
    machine.spend(2.0)
    with clock.paused():
        machine.spend(-500.0)
    machine.spend(1.0)
    assert clock.read() == Seconds(6.0, 12.0)
    assert pauses == [(0.0, 0.0)]


def snapshots(before_s: float, until_s: float) -> list[float]:
    """Seconds of the optimisation at which snapshots are taken, looking every tenth."""
    taken = [0.0]
    for tenth in range(1, round(10 * until_s)):
        if snapshot_due(taken[-1], tenth / 10, before_s):
            taken.append(tenth / 10)
    return taken[1:]


def test_snapshots_are_due_at_geometric_times():
    assert snapshots(0.0, 70.0) == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0]


def test_snapshots_are_due_at_geometric_times_of_the_whole_training_clock_too():
    # The clock reads 12 s at the start: 16, 32 and 64 s of it come 4, 20 and 52 s later.
    assert snapshots(12.0, 70.0) == [1.0, 2.0, 4.0, 8.0, 16.0, 20.0, 32.0, 52.0, 64.0]
