from __future__ import annotations

import pytest
import torch
from torch import nn

from mocoflow_core.training.checkpoint import (
    Progress,
    load_checkpoint,
    remove_checkpoint,
    save_checkpoint,
)
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.guard import GuardEvent


class Run:
    """A network that learns noise drawn from a generator of its own."""

    def __init__(self, seed: int) -> None:
        torch.manual_seed(seed)
        self.model = nn.Linear(3, 2)
        self.optimiser = torch.optim.Adam(self.model.parameters(), lr=0.1)
        self.generator = torch.Generator().manual_seed(seed)

    def steps(self, count: int) -> None:
        for _ in range(count):
            x = torch.randn(5, 3, generator=self.generator)
            self.optimiser.zero_grad()
            (self.model(x) - x[:, :2]).square().sum().backward()
            self.optimiser.step()

    @property
    def parts(self) -> tuple:
        return self.model, self.optimiser, self.generator


PROGRESS = Progress(
    threads=2,
    steps=50,
    rays=512,
    started_s=0.75,
    step=20,
    rate_scale=0.25,
    elapsed=Seconds(12.5, 20.25),
    snapshot_s=8.25,
    reached=True,
    events=[GuardEvent(7, "loss photometric is nan")],
    best=0.25,
    recent=[0.5, 0.125],
    losses=[{"photometric": 0.5}],
    averaged=20,
    tries=2,
)
GOOD = {"weight/bias": torch.ones(2)}
MEANS = {"bias": torch.zeros(2)}


def test_the_guard_s_good_state_survives_the_file(tmp_path):
    save_checkpoint(tmp_path, PROGRESS, *Run(0).parts, GOOD, MEANS)
    restored = load_checkpoint(tmp_path, *Run(1).parts)
    assert restored.good.keys() == GOOD.keys()
    assert torch.equal(restored.good["weight/bias"], GOOD["weight/bias"])


def test_progress_survives_the_file(tmp_path):
    save_checkpoint(tmp_path, PROGRESS, *Run(0).parts, GOOD, MEANS)
    assert load_checkpoint(tmp_path, *Run(1).parts).progress == PROGRESS


@pytest.mark.parametrize("steps", [0, 7])
def test_a_restored_run_goes_on_like_the_saved_one(tmp_path, steps):
    saved, restored = Run(0), Run(1)
    saved.steps(steps)
    save_checkpoint(tmp_path, PROGRESS, *saved.parts, GOOD, MEANS)
    load_checkpoint(tmp_path, *restored.parts)
    saved.steps(10)
    restored.steps(10)
    # Weights, moments, the optimiser's own step count and the random draws.
    assert torch.equal(saved.model.weight, restored.model.weight)
    assert torch.equal(saved.model.bias, restored.model.bias)


def test_without_a_checkpoint_nothing_changes(tmp_path):
    run, untouched = Run(0), Run(0)
    assert load_checkpoint(tmp_path, *run.parts) is None
    run.steps(3)
    untouched.steps(3)
    assert torch.equal(run.model.weight, untouched.model.weight)


def test_a_half_written_checkpoint_leaves_the_old_one(tmp_path):
    run = Run(0)
    save_checkpoint(tmp_path, PROGRESS, *run.parts, GOOD, MEANS)
    for file in tmp_path.iterdir():
        (tmp_path / (file.name + ".tmp")).write_bytes(file.read_bytes()[:50])
    assert load_checkpoint(tmp_path, *run.parts).progress == PROGRESS


def test_the_last_of_many_checkpoints_counts_and_leaves_no_litter(tmp_path):
    run = Run(0)
    for step in (1, 2, 3):
        save_checkpoint(
            tmp_path, Progress(threads=1, steps=9, rays=8, step=step), *run.parts, GOOD, MEANS
        )
    assert load_checkpoint(tmp_path, *run.parts).progress.step == 3
    assert len(list(tmp_path.iterdir())) == 1


def test_a_checkpoint_of_another_model_is_refused(tmp_path):
    save_checkpoint(tmp_path, PROGRESS, *Run(0).parts, GOOD, MEANS)
    other = nn.Linear(4, 4)
    optimiser = torch.optim.Adam(other.parameters())
    with pytest.raises(RuntimeError):
        load_checkpoint(tmp_path, other, optimiser, torch.Generator())


def test_a_removed_checkpoint_is_gone_and_removing_it_again_is_no_error(tmp_path):
    run = Run(0)
    save_checkpoint(tmp_path, PROGRESS, *run.parts, GOOD, MEANS)
    remove_checkpoint(tmp_path)
    remove_checkpoint(tmp_path)
    assert load_checkpoint(tmp_path, *run.parts) is None
