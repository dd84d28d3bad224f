from __future__ import annotations

import pytest
import torch

from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.objective import ShellObjective
from tests.toy_training import Prepared


def terms_and_gradients(prepared: Prepared, losses: LossConfig, disagree: bool = True):
    field = prepared.field()
    field.anneal(0.0)
    if disagree:
        with torch.no_grad():
            field.motion.residual_to_observed.network[-1].bias[3] = 0.02
    pixels = TrainingPixels(prepared.clip, prepared.scene())
    generator = torch.Generator().manual_seed(0)
    batch = pixels.batch(200, 4, generator)
    objective = ShellObjective(prepared.scene(field), losses, motion_learned=True)
    return field, objective(batch, generator)


def motion_gradient(field, loss: torch.Tensor) -> float:
    field.zero_grad()
    loss.backward(retain_graph=True)
    gradients = [p.grad for p in field.motion.parameters() if p.grad is not None]
    assert all(torch.isfinite(gradient).all() for gradient in gradients)
    return max((float(gradient.abs().max()) for gradient in gradients), default=0.0)


def test_directions_that_disagree_are_pulled_together(prepared):
    field, terms = terms_and_gradients(prepared, LossConfig())
    # A shift of 0.02 radii of the canonical box, once in the local and twice in the global term.
    shift_m = 0.02 * field.motion.residual_to_observed.radius
    assert float(terms["consensus"].detach()) == pytest.approx(0.2 * 3 * shift_m, rel=0.5)
    assert motion_gradient(field, terms["consensus"]) > 0


def test_at_the_start_both_directions_nearly_agree(prepared):
    _, terms = terms_and_gradients(prepared, LossConfig(), disagree=False)
    # Millimetres: the round trip of the body's own motion.
    assert float(terms["consensus"].detach()) < 0.2 * 0.01


def test_points_under_the_density_threshold_pull_on_nothing(prepared):
    field, terms = terms_and_gradients(prepared, LossConfig(density_threshold=1e9))
    for name in ("consensus", "residual", "smoothness"):
        assert float(terms[name].detach()) == 0.0
        assert motion_gradient(field, terms[name]) == 0.0


def test_the_sum_of_all_losses_has_finite_gradients_everywhere(prepared):
    field, terms = terms_and_gradients(prepared, LossConfig())
    field.zero_grad()
    torch.stack(list(terms.values())).sum().backward()
    for name, parameter in field.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name


def test_shares_switch_the_two_terms_of_the_consensus_one_by_one(prepared):
    both, local, far = (
        float(terms_and_gradients(prepared, losses)[1]["consensus"].detach())
        for losses in (LossConfig(), LossConfig(global_share=0.0), LossConfig(local_share=0.0))
    )
    assert local > 0
    assert far > 0
    assert both == pytest.approx(local + far, rel=1e-5)


def test_each_weight_scales_its_own_loss_alone(prepared):
    before = terms_and_gradients(prepared, LossConfig())[1]
    names = {"silhouette": "silhouette_weight", "consensus": "consensus_weight"}
    for name, weight in names.items():
        doubled = LossConfig(**{weight: 2 * getattr(LossConfig(), weight)})
        after = terms_and_gradients(prepared, doubled)[1]
        for other in before:
            factor = 2.0 if other == name else 1.0
            found, expected = float(after[other].detach()), float(before[other].detach())
            assert found == pytest.approx(factor * expected, rel=1e-5), other
