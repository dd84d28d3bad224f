from __future__ import annotations

import pytest
import torch
from torch import nn

from mocoflow_core.errors import InputError
from mocoflow_core.training.checkpoint import (
    Progress,
    read_checkpoint,
    remove_checkpoint,
    restore_checkpoint,
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
MADE_WITH = {"seed": 3, "losses": {"offset_weight": 1.0}}


def save(folder, run, progress=PROGRESS):
    save_checkpoint(folder, MADE_WITH, progress, *run.parts, GOOD, MEANS)


def load(folder, run, made_with=MADE_WITH):
    return restore_checkpoint(read_checkpoint(folder), folder, made_with, *run.parts)


def test_the_guard_s_good_state_survives_the_file(tmp_path):
    save(tmp_path, Run(0))
    restored = load(tmp_path, Run(1))
    assert restored.good.keys() == GOOD.keys()
    assert torch.equal(restored.good["weight/bias"], GOOD["weight/bias"])


def test_progress_survives_the_file(tmp_path):
    save(tmp_path, Run(0))
    assert load(tmp_path, Run(1)).progress == PROGRESS


@pytest.mark.parametrize("steps", [0, 7])
def test_a_restored_run_goes_on_like_the_saved_one(tmp_path, steps):
    saved, restored = Run(0), Run(1)
    saved.steps(steps)
    save(tmp_path, saved)
    load(tmp_path, restored)
    saved.steps(10)
    restored.steps(10)
    # Weights, moments, the optimiser's own step count and the random draws.
    assert torch.equal(saved.model.weight, restored.model.weight)
    assert torch.equal(saved.model.bias, restored.model.bias)


def test_without_a_checkpoint_there_is_nothing_to_read(tmp_path):
    assert read_checkpoint(tmp_path) == b""


def test_a_half_written_checkpoint_leaves_the_old_one(tmp_path):
    run = Run(0)
    save(tmp_path, run)
    for file in tmp_path.iterdir():
        (tmp_path / (file.name + ".tmp")).write_bytes(file.read_bytes()[:50])
    assert load(tmp_path, run).progress == PROGRESS


def test_the_last_of_many_checkpoints_counts_and_leaves_no_litter(tmp_path):
    run = Run(0)
    for step in (1, 2, 3):
        save(tmp_path, run, Progress(threads=1, steps=9, rays=8, step=step))
    assert load(tmp_path, run).progress.step == 3
    assert len(list(tmp_path.iterdir())) == 1


def test_a_checkpoint_of_another_model_is_refused(tmp_path):
    save(tmp_path, Run(0))
    other = nn.Linear(4, 4)
    optimiser = torch.optim.Adam(other.parameters())
    with pytest.raises(RuntimeError):
        restore_checkpoint(
            read_checkpoint(tmp_path), tmp_path, MADE_WITH, other, optimiser, torch.Generator()
        )


@pytest.mark.parametrize(
    ("other", "held", "asked"),
    [
        ({"seed": 4}, "seed = 3", "with 4"),
        ({"losses": {"offset_weight": 0.5}}, "losses.offset_weight = 1.0", "with 0.5"),
        ({"sampling": {"step_m": 0.5}}, "sampling = None", "with {'step_m': 0.5}"),
    ],
)
def test_a_checkpoint_of_other_settings_is_refused_naming_both_sides(tmp_path, other, held, asked):
    save(tmp_path, Run(0))
    untouched, run = Run(1), Run(1)
    with pytest.raises(InputError) as refused:
        load(tmp_path, run, MADE_WITH | other)
    assert held in str(refused.value)
    assert asked in str(refused.value)
    assert torch.equal(run.model.weight, untouched.model.weight)


def test_a_removed_checkpoint_is_gone_and_removing_it_again_is_no_error(tmp_path):
    run = Run(0)
    save(tmp_path, run)
    remove_checkpoint(tmp_path)
    remove_checkpoint(tmp_path)
    assert read_checkpoint(tmp_path) == b""
