"""The mean of the last weights: what it is, what it leaves alone, how it goes on."""

from __future__ import annotations

import torch
from torch import nn

from mocoflow_core.training.averaged_weights import AveragedWeights


def model(value: float) -> nn.Linear:
    made = nn.Linear(2, 1)
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.fill_(value)
    return made


def walk(learned: nn.Linear, average: AveragedWeights, values) -> None:
    for value in values:
        with torch.no_grad():
            learned.weight.fill_(value)
        average.update()


def test_weights_that_dance_around_a_value_have_a_mean_near_it():
    learned = model(50.0)
    average = AveragedWeights(learned, 0.97)
    walk(learned, average, [3.0 + (-1) ** step for step in range(400)])
    with average.shown():
        assert abs(learned.weight[0, 0].item() - 3.0) < 0.05
    assert learned.weight[0, 0].item() == 2.0


def test_the_start_is_soon_forgotten():
    learned = model(50.0)
    average = AveragedWeights(learned, 0.97)
    walk(learned, average, [1.0] * 60)
    average.take()
    assert abs(learned.weight[0, 0].item() - 1.0) < 1e-3


def test_without_averaging_the_last_weights_are_shown_bit_for_bit():
    learned = model(0.0)
    average = AveragedWeights(learned, 0.0)
    walk(learned, average, [0.1, 0.7, 0.3])
    expected = learned.weight.detach().clone()
    average.take()
    assert torch.equal(learned.weight, expected)
    assert average.state() == {}


def test_the_mean_has_the_precision_of_the_weights_that_are_trained():
    learned = model(1.0)
    average = AveragedWeights(learned, 0.97)
    learned.double()
    walk(learned, average, [2.0, 3.0])
    assert average.state()["weight"].dtype == torch.float64


def test_frozen_weights_have_no_mean():
    learned = model(1.0)
    learned.bias.requires_grad_(False)
    assert list(AveragedWeights(learned, 0.9).state()) == ["weight"]


def test_after_a_restart_the_present_weights_are_the_mean():
    learned = model(0.0)
    average = AveragedWeights(learned, 0.97)
    walk(learned, average, [torch.nan, 5.0])
    average.restart()
    walk(learned, average, [5.0])
    average.take()
    assert learned.weight[0, 0].item() == 5.0


def test_a_restored_average_goes_on_like_the_saved_one():
    ours, theirs = model(0.0), model(0.0)
    saved, restored = AveragedWeights(ours, 0.97), AveragedWeights(theirs, 0.97)
    walk(ours, saved, [4.0, 2.0])
    restored.restore(saved.state(), saved.steps)
    for learned, average in ((ours, saved), (theirs, restored)):
        walk(learned, average, [1.0, 8.0])
        average.take()
    assert torch.equal(ours.weight, theirs.weight)
