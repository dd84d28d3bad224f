from __future__ import annotations

import copy

import pytest
import torch
from torch import nn

from mocoflow_core.training.guard import Guard, TrainingDiverged


class Run:
    """A small network that learns a line, with a guard that watches it."""

    def __init__(self, allowed: int = 3) -> None:
        torch.manual_seed(0)
        self.model = nn.Sequential(nn.Linear(2, 4), nn.Tanh(), nn.Linear(4, 1))
        self.optimiser = torch.optim.Adam(self.model.parameters(), lr=0.05)
        self.guard = Guard(self.model, self.optimiser, allowed)

    def gradients(self, plant: float | None = None) -> dict[str, torch.Tensor]:
        x = torch.linspace(-1, 1, 10)[:, None].expand(10, 2)
        loss = ((self.model(x) - 2 * x[:, :1]) ** 2).mean()
        self.optimiser.zero_grad()
        loss.backward()
        if plant is not None:
            self.model[2].weight.grad[0, 1] = plant
        return {"photometric": loss}

    def steps(self, count: int) -> None:
        for _ in range(count):
            self.gradients()
            self.optimiser.step()

    def state(self) -> list[torch.Tensor]:
        return [p.detach().clone() for p in self.model.parameters()]


def same(first: list[torch.Tensor], second: list[torch.Tensor]) -> bool:
    return all(torch.equal(ours, theirs) for ours, theirs in zip(first, second, strict=True))


def test_a_healthy_step_has_no_problem():
    run = Run()
    assert run.guard.problem(run.gradients()) is None


@pytest.mark.parametrize("value", [torch.nan, torch.inf, -torch.inf])
def test_a_loss_that_is_not_finite_is_named(value):
    run = Run()
    terms = run.gradients() | {"consensus": torch.tensor(value)}
    assert "consensus" in run.guard.problem(terms)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_gradient_that_is_not_finite_is_named(value):
    run = Run()
    problem = run.guard.problem(run.gradients(plant=value))
    assert "gradient" in problem
    assert "2.weight" in problem


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_weight_that_is_not_finite_is_named_even_where_no_loss_sees_it(value):
    run = Run()
    terms = run.gradients()
    with torch.no_grad():
        run.model[0].weight[1, 0] = value
    problem = run.guard.problem(terms)
    assert "weight" in problem
    assert "0.weight" in problem


def test_frozen_parameters_without_gradients_are_no_problem():
    run = Run()
    run.model[0].requires_grad_(False)
    run.optimiser.zero_grad(set_to_none=True)
    assert run.guard.problem(run.gradients()) is None


def test_a_refused_step_goes_back_to_the_last_good_weights_and_halves_the_rate():
    run = Run()
    run.steps(3)
    run.guard.remember()
    good = run.state()
    run.steps(2)
    run.guard.refuse(5, "loss photometric is nan")
    assert same(run.state(), good)
    assert run.guard.rate_scale == 0.5
    assert [(event.step, event.what) for event in run.guard.events] == [
        (5, "loss photometric is nan")
    ]


@pytest.mark.parametrize("before", [0, 3])
def test_after_a_refusal_training_goes_on_as_from_the_good_state(before):
    run = Run()
    run.steps(before)
    run.guard.remember()
    expected = copy.deepcopy(run)
    run.steps(4)
    run.guard.refuse(before + 4, "gradient")
    run.steps(5)
    expected.steps(5)
    # The optimiser's moments went back too, not only the weights.
    assert same(run.state(), expected.state())


def test_refusing_twice_goes_back_to_the_same_state():
    run = Run(allowed=5)
    run.steps(2)
    run.guard.remember()
    good = run.state()
    for _ in range(2):
        run.steps(3)
        run.guard.refuse(0, "x")
    assert same(run.state(), good)
    assert run.guard.rate_scale == 0.25


def test_a_bad_state_is_never_remembered():
    run = Run()
    run.steps(2)
    run.guard.remember()
    good = run.state()
    with torch.no_grad():
        run.model[0].bias.fill_(torch.nan)
    run.guard.remember()
    run.guard.refuse(2, "weight 0.bias is not finite")
    assert same(run.state(), good)


def test_a_bad_start_is_refused_in_words():
    run = Run()
    with torch.no_grad():
        run.model[2].bias.fill_(torch.nan)
    with pytest.raises(TrainingDiverged, match=r"2\.bias"):
        Guard(run.model, run.optimiser, 3)


def test_after_the_allowed_number_of_events_it_stops_and_says_what_and_where():
    run = Run(allowed=3)
    for step in range(3):
        run.guard.refuse(step, "loss consensus is nan")
    with pytest.raises(TrainingDiverged) as stopped:
        run.guard.refuse(117, "gradient of canonical.tables.0 is not finite")
    text = str(stopped.value)
    assert "117" in text
    assert "canonical.tables.0" in text
    assert "schedule.rate" in text
    assert len(run.guard.events) == 4


def spoil(run: Run) -> None:
    """A moment of the optimiser that is no number."""
    run.optimiser.state[run.model[0].weight]["exp_avg"][0, 0] = torch.nan


def test_a_state_whose_moments_are_not_finite_is_never_remembered():
    run = Run()
    run.steps(2)
    run.guard.remember()
    good = run.state()
    run.steps(1)
    spoil(run)
    run.guard.remember()
    run.guard.refuse(3, "x")
    assert same(run.state(), good)
    assert all(torch.isfinite(s["exp_avg"]).all() for s in run.optimiser.state.values())


def test_a_start_with_moments_that_are_not_finite_is_refused_in_words():
    run = Run()
    run.steps(1)
    spoil(run)
    with pytest.raises(TrainingDiverged, match=r"exp_avg of 0\.weight"):
        Guard(run.model, run.optimiser, 3)


def look(run: Run, loss: float, steps: int) -> str | None:
    """The last thing the guard says of so many steps of one loss."""
    for _ in range(steps):
        said = run.guard.problem({"photometric": torch.tensor(loss)})
    return said


def test_losses_that_rise_far_above_the_expected_are_named_after_some_steps():
    run = Run()
    run.guard.expect(0.02)
    assert look(run, 0.1, 9) is None
    assert "risen from 0.02 to 0.1" in look(run, 0.1, 1)


def test_an_outlier_is_no_rise():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.02, 6)
    assert look(run, 50.0, 4) is None


def test_a_small_loss_may_rise():
    run = Run()
    run.guard.expect(1e-6)
    assert look(run, 1e-3, 20) is None


def test_few_rays_are_looked_at_for_longer():
    run = Run()
    guard = Guard(run.model, run.optimiser, 3, rays=50)
    guard.expect(0.02)
    said = [guard.problem({"photometric": torch.tensor(0.5)}) for _ in range(20)]
    assert said[:-1] == [None] * 19
    assert said[-1] is not None


def test_a_state_is_kept_only_where_the_last_steps_prove_it_good():
    run = Run()
    run.guard.expect(0.02)
    good = run.state()
    run.steps(1)
    assert run.guard.settle() is None  # nothing is known of it
    look(run, 0.05, 10)
    assert "risen" in run.guard.settle()
    run.guard.refuse(11, "x")
    assert same(run.state(), good)
    run.steps(1)
    better = run.state()
    look(run, 0.01, 10)
    assert run.guard.settle() is None
    run.steps(1)
    run.guard.refuse(22, "x")
    assert same(run.state(), better)


def test_after_a_refusal_old_losses_are_forgotten_and_a_few_new_ones_prove_nothing():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.5, 10)
    run.guard.refuse(10, "x")
    assert run.guard.decline() is None  # the state is the good one
    assert look(run, 0.02, 1) is None
    assert "too few" in run.guard.decline()
    look(run, 0.02, 4)
    assert run.guard.decline() is None


def test_after_a_rise_the_rates_are_cut_further_than_after_a_number_that_is_not_finite():
    run = Run()
    run.guard.expect(0.02)
    run.guard.refuse(3, "gradient")
    halved = run.guard.rate_scale
    look(run, 0.1, 10)
    run.guard.refuse(14, "risen")
    assert run.guard.rate_scale < 0.5 * halved == 0.25


def test_what_the_last_losses_say_decides_the_cut_whatever_the_reason():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.05, 5)
    run.guard.refuse(6, "gradient of 0.weight is not finite")
    assert run.guard.events[0].rates == run.guard.rate_scale < 0.5


def test_after_a_rise_the_next_one_is_met_earlier():
    run = Run()
    run.guard.expect(0.02)
    assert look(run, 0.07, 10) is None
    look(run, 0.2, 10)
    run.guard.refuse(20, "risen")
    assert "risen" in look(run, 0.07, 10)


def test_rates_that_hold_after_a_rise_are_a_trial_and_lower_ones_start_from_the_good_state():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.2, 10)
    run.guard.refuse(10, "risen")
    tried = run.guard.rate_scale
    assert look(run, 0.02, 9) is None
    assert "hold" in look(run, 0.02, 1)
    run.guard.refuse(20, "hold")
    assert run.guard.rate_scale == 0.5 * tried
    assert look(run, 0.02, 30) is None  # one trial is enough


def test_a_refusal_without_a_rise_leaves_the_guard_as_patient_as_it_was():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.02, 10)
    run.guard.refuse(10, "gradient of 0.weight is not finite")
    assert look(run, 0.07, 10) is None


def test_a_run_of_a_step_or_two_without_any_refusal_is_not_judged():
    run = Run()
    run.guard.expect(0.02)
    look(run, 0.5, 2)
    assert run.guard.decline() is None


def test_a_start_that_is_not_finite_expects_nothing():
    run = Run()
    run.guard.expect(float("nan"))
    assert look(run, 5.0, 20) is None
