"""A machine that loses power in any stage: the next run finishes from what is there."""

from __future__ import annotations

import time

import pytest

from mocoflow_core.io.holdings import FolderHoldings
from mocoflow_core.io.run_folder import read_run
from tests.e2e.services import ENDED, services, until
from tests.flows.stages import STAGES

pytestmark = pytest.mark.faults

QUICK = ["person_scores.use=off", "evaluation.frames_per_camera=1"]


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    with services(tmp_path_factory.mktemp("killed")) as made:
        yield made


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """One run with its store, which dies in every stage in turn."""
    return tmp_path_factory.mktemp("dying")


def start(parts, scene, root):
    return parts.made.start(
        "mocoflow/full",
        **{"scene": str(scene), "out": str(root / "run"), "store": str(root / "store")},
        preset="toy",
        settings=QUICK,
    )


def whole(store):
    """The stages whose artifacts a store holds, every digest compared."""
    place = FolderHoldings(store)
    held = {item.name: place.verify(item) for item in place.look() if not item.leftover}
    assert set(held.values()) <= {None}, held
    return [stage for stage in STAGES if any(name.startswith(f"{stage}/") for name in held)]


def unfinished(store):
    return [item.name.partition("/")[0] for item in FolderHoldings(store).look() if item.leftover]


def kill_in(parts, stage, run):
    """Kill the worker and all that it runs as soon as the stage has a workspace."""
    end = time.monotonic() + 300.0
    while not any(stage.glob("*.partial")) and not any(stage.glob("*/manifest.json")):
        assert time.monotonic() < end, parts.made.state(run)
        time.sleep(0.001)
    parts.worker.kill()


@pytest.mark.parametrize("stage", STAGES)
def test_a_worker_killed_in_a_stage_loses_this_stage_alone(parts, scene, root, stage):
    before, store = STAGES[: STAGES.index(stage)], root / "store"
    for _ in range(5):
        kill_in(parts, store / stage, start(parts, scene, root))
        parts.worker.start()
        if stage not in whole(store):
            break
        for item in FolderHoldings(store).look():  # The stage was faster than the signal.
            if item.name.startswith(f"{stage}/"):
                FolderHoldings(store).remove(item, lambda: False)
    assert whole(store) == before
    assert unfinished(store) == [stage]


def test_the_run_that_died_in_every_stage_is_finished_by_one_that_nothing_happens_to(
    parts, scene, root
):
    assert parts.made.wait(start(parts, scene, root), *ENDED, within_s=300.0) == "COMPLETED"
    record = read_run(root / "run")
    assert [stage.name for stage in record.stages] == STAGES
    assert {stage.name for stage in record.stages if not stage.cached} <= {STAGES[-1]}
    assert whole(root / "store") == STAGES
    assert unfinished(root / "store") == []


def test_a_worker_killed_alone_loses_at_most_the_stage_that_its_run_was_in(parts, scene, tmp_path):
    """Its run goes on until it writes a line of its log, which the worker has taken so far."""
    store = tmp_path / "store"
    run = start(parts, scene, tmp_path)
    until(lambda: list(store.glob("*/*.partial")), 300.0, "a stage works", 0.01)
    parts.worker.kill_alone()
    try:
        ended = parts.made.wait(run, *ENDED, within_s=300.0)
    finally:
        parts.worker.start()
    before = set(whole(store))
    assert ended in ("COMPLETED", "CRASHED"), parts.made.logs(run)
    assert parts.made.wait(start(parts, scene, tmp_path), *ENDED, within_s=300.0) == "COMPLETED"
    record = read_run(tmp_path / "run")
    assert before <= {stage.name for stage in record.stages if stage.cached or ended == "COMPLETED"}
    assert whole(store) == STAGES
