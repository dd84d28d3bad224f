"""A machine that loses power in any stage: the next run finishes from what is there."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from mocoflow_core.io.holdings import FolderHoldings
from mocoflow_core.io.run_folder import read_run
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene
from tests.e2e.services import ENDED, services, until
from tests.flows.stages import STAGES
from tests.flows.test_paper import TINY

pytestmark = pytest.mark.faults

QUICK = ("person_scores.use=off", "evaluation.frames_per_camera=1")
NETWORKS = tuple(setting for setting in TINY if not setting.startswith("person_scores"))
_LOCATED = STAGES.index("extract_clip") + 1


@dataclass(frozen=True)
class Kind:
    """A run that dies in some of its stages in turn."""

    dies_in: list[str]
    stages: list[str]
    preset: str = "toy"
    settings: tuple[str, ...] = QUICK
    located: bool = True


KINDS = {
    "toy": Kind(STAGES, STAGES),
    "unlocated": Kind(
        ["locate_body"], [*STAGES[:_LOCATED], "locate_body", *STAGES[_LOCATED:]], located=False
    ),
    "networks": Kind(
        ["pretrain_density", "fit_motion", "optimise_scene"],
        STAGES,
        "paper_small",
        (*QUICK, *NETWORKS),
    ),
}
DEATHS = [(name, stage) for name, kind in KINDS.items() for stage in kind.dies_in]


@dataclass(frozen=True)
class Dying:
    """Such a run with its store."""

    kind: Kind
    root: Path

    @property
    def store(self) -> Path:
        return self.root / "store"

    def start(self, parts) -> str:
        return parts.made.start(
            "mocoflow/full",
            scene=str(self.root / "scene"),
            out=str(self.root / "run"),
            store=str(self.store),
            preset=self.kind.preset,
            settings=self.kind.settings,
        )


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    with services(tmp_path_factory.mktemp("killed")) as made:
        yield made


@pytest.fixture(scope="module")
def dying(tmp_path_factory):
    """The runs by their kind."""
    made = {name: Dying(kind, tmp_path_factory.mktemp(name)) for name, kind in KINDS.items()}
    for run in made.values():
        write_toy_scene(run.root / "scene", ToyConfig(located=run.kind.located))
    return made


def whole(run):
    """The stages whose artifacts its store holds, every digest compared."""
    place = FolderHoldings(run.store)
    held = {item.name: place.verify(item) for item in place.look() if not item.leftover}
    assert set(held.values()) <= {None}, held
    return [
        stage for stage in run.kind.stages if any(name.startswith(f"{stage}/") for name in held)
    ]


def unfinished(run):
    held = FolderHoldings(run.store).look()
    return [item.name.partition("/")[0] for item in held if item.leftover]


def kill_in(parts, stage, run):
    """Kill the worker and all that it runs as soon as the stage has a workspace."""
    end = time.monotonic() + 300.0
    while not any(stage.glob("*.partial")) and not any(stage.glob("*/manifest.json")):
        assert time.monotonic() < end, parts.made.state(run)
        time.sleep(0.001)
    parts.worker.kill()


@pytest.mark.parametrize(("kind", "stage"), DEATHS)
def test_a_worker_killed_in_a_stage_loses_this_stage_alone(parts, dying, kind, stage):
    run = dying[kind]
    place = FolderHoldings(run.store)
    for _ in range(5):
        kill_in(parts, run.store / stage, run.start(parts))
        parts.worker.start()
        if stage not in whole(run):
            break
        for item in place.look():  # The stage was faster than the signal.
            if item.name.startswith(f"{stage}/"):
                place.remove(item, lambda: False)
    assert whole(run) == run.kind.stages[: run.kind.stages.index(stage)]
    assert unfinished(run) == [stage]


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_that_died_in_its_stages_is_finished_by_one_that_nothing_happens_to(
    parts, dying, kind
):
    run = dying[kind]
    assert parts.made.wait(run.start(parts), *ENDED, within_s=300.0) == "COMPLETED"
    record, stages = read_run(run.root / "run"), run.kind.stages
    assert [stage.name for stage in record.stages] == stages
    left = stages[stages.index(run.kind.dies_in[-1]) :]
    assert {stage.name for stage in record.stages if not stage.cached} <= set(left)
    assert whole(run) == stages
    assert unfinished(run) == []


def test_a_worker_killed_alone_loses_at_most_the_stage_that_its_run_was_in(parts, scene, tmp_path):
    """Its run goes on until it writes a line of its log, which the worker has taken so far."""
    run = Dying(KINDS["toy"], tmp_path)
    (tmp_path / "scene").symlink_to(scene)
    begun = run.start(parts)
    until(lambda: list(run.store.glob("*/*.partial")), 300.0, "a stage works", 0.01)
    parts.worker.kill_alone()
    try:
        ended = parts.made.wait(begun, *ENDED, within_s=300.0)
    finally:
        parts.worker.start()
    before = set(whole(run))
    assert ended in ("COMPLETED", "CRASHED"), parts.made.logs(begun)
    assert parts.made.wait(run.start(parts), *ENDED, within_s=300.0) == "COMPLETED"
    record = read_run(tmp_path / "run")
    assert before <= {stage.name for stage in record.stages if stage.cached or ended == "COMPLETED"}
    assert whole(run) == STAGES
