from __future__ import annotations

import pytest
import torch

from mocoflow_core.rendering.compositing import composite, running_count, sum_along_rays


def one_ray(density: torch.Tensor, step_m: float | torch.Tensor):
    steps = torch.as_tensor(step_m, dtype=density.dtype).expand(len(density))
    weights, left = composite(density, steps, torch.zeros(len(density), dtype=torch.int64), 1)
    return weights, left[0]


def packed(rays: int = 30, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Densities, steps and rays of samples; some rays are empty, densities span 12 decades."""
    generator = torch.Generator().manual_seed(seed)
    counts = torch.randint(0, 20, (rays,), generator=generator)
    counts[::7] = 0
    ray = torch.repeat_interleave(torch.arange(rays), counts)
    density = 10 ** (12 * torch.rand(len(ray), generator=generator) - 6)
    return density, 0.001 + 0.05 * torch.rand(len(ray), generator=generator), ray


def by_the_book(density: torch.Tensor, step_m: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """One ray, one sample after the other."""
    left, weights = torch.ones((), dtype=torch.float64), []
    for thickness in density.double() * step_m.double():
        weights.append(left * -torch.expm1(-thickness))
        left = left * torch.exp(-thickness)
    return torch.stack(weights) if weights else left.new_zeros(0), left


def test_every_ray_is_composited_as_if_it_were_alone():
    density, step_m, ray = packed()
    weights, left = composite(density, step_m, ray, 30)
    for index in range(30):
        mine = ray == index
        expected, behind = by_the_book(density[mine], step_m[mine])
        assert weights[mine].numpy() == pytest.approx(expected.numpy(), abs=1e-6)
        assert float(left[index]) == pytest.approx(float(behind), abs=1e-6)


def test_weights_and_transmittance_sum_to_one():
    density, step_m, ray = packed()
    weights, left = composite(density, step_m, ray, 30)
    assert (sum_along_rays(weights, ray, 30) + left).numpy() == pytest.approx(1.0, abs=1e-6)
    assert ((weights >= 0) & (weights <= 1)).all()
    assert ((left >= 0) & (left <= 1)).all()


@pytest.mark.parametrize("density", [0.01, 3.0, 500.0])
@pytest.mark.parametrize("cuts", [1, 7, 1000])
def test_constant_density_gives_the_closed_form_for_any_sampling(density, cuts):
    length = 0.4
    generator = torch.Generator().manual_seed(cuts)
    borders = torch.cat(
        [
            torch.zeros(1).double(),
            torch.rand(cuts - 1, generator=generator).double().sort().values,
            torch.ones(1).double(),
        ]
    )
    weights, left = one_ray(torch.full((cuts,), density).double(), length * borders.diff())
    expected = torch.exp(torch.tensor(-density * length).double())
    # Only single precision of the given density and length.
    assert float(left) == pytest.approx(float(expected), rel=1e-5)
    assert float(weights.sum()) == pytest.approx(1 - float(expected), rel=1e-5)


@pytest.mark.parametrize("place", [0, 4, 9])
def test_one_opaque_sample_gets_all_the_weight(place):
    density = torch.zeros(10)
    density[place] = 1e6
    weights, left = one_ray(density, 0.02)
    expected = torch.zeros(10)
    expected[place] = 1.0
    assert torch.equal(weights, expected)
    assert float(left) < 1e-30


def test_the_last_sample_is_no_thicker_than_its_step():
    # A last step of endless length would hide the background behind the faintest density.
    weights, left = one_ray(torch.tensor([0.0, 0.0, 1.0]), 0.01)
    assert float(weights[-1]) == pytest.approx(0.00995, abs=1e-5)
    assert float(left) == pytest.approx(0.99005, abs=1e-5)


def test_zero_density_is_invisible_exactly():
    weights, left = one_ray(torch.zeros(100), 0.01)
    assert torch.equal(weights, torch.zeros(100))
    assert float(left) == 1.0


def test_a_faint_density_is_not_rounded_away():
    weights, _ = one_ray(torch.full((10,), 1e-12), 0.01)
    assert weights.numpy() == pytest.approx(1e-14, rel=1e-5)


@pytest.mark.parametrize("density", [1e6, 1e30, 3e38, torch.inf])
def test_huge_densities_keep_values_and_gradients_finite(density):
    values = torch.full((50,), density, requires_grad=True)
    weights, left = one_ray(values, 0.015)
    assert float(weights.detach()[0]) == 1.0
    assert not weights.detach()[1:].any() or float(weights.detach()[1:].max()) < 1e-30
    (weights.sum() + left).backward()
    assert torch.isfinite(values.grad).all()


def test_ten_thousand_samples_sum_to_one():
    density = 50 * torch.rand(10_000, generator=torch.Generator().manual_seed(0))
    weights, left = one_ray(density, 0.001)
    expected, behind = by_the_book(density, torch.full((10_000,), 0.001))
    assert weights.numpy() == pytest.approx(expected.numpy(), abs=1e-7)
    assert float(left) == pytest.approx(float(behind), rel=1e-5)
    # Ten thousand roundings of single precision in the sum itself.
    assert float(weights.double().sum() + left) == pytest.approx(1.0, abs=1e-5)


def test_transmittance_underflows_to_nothing_without_nan():
    values = torch.full((10_000,), 1e5, requires_grad=True)
    weights, left = one_ray(values, 0.01)
    assert float(left.detach()) == 0.0
    assert float(weights.detach().sum()) == 1.0
    (weights * torch.arange(10_000)).sum().backward()
    assert torch.isfinite(values.grad).all()


def test_opaque_rays_before_it_take_no_digits_from_a_ray():
    # All rays share one running sum.
    many = 2000
    density = torch.cat([torch.full((100 * many,), 1e9), torch.tensor([1.0, 2.0, 3.0])])
    ray = torch.cat([torch.arange(many).repeat_interleave(100), torch.full((3,), many)])
    weights, left = composite(density, torch.full_like(density, 0.01), ray, many + 1)
    expected, behind = by_the_book(density[-3:], torch.full((3,), 0.01))
    assert weights[-3:].numpy() == pytest.approx(expected.numpy(), rel=1e-6)
    assert float(left[-1]) == pytest.approx(float(behind), rel=1e-6)


def test_a_ray_without_samples_is_all_background_exactly():
    density, ray = torch.tensor([1e6, 5.0]), torch.tensor([1, 1])
    _, left = composite(density, torch.full((2,), 0.01), ray, 4)
    assert left[[0, 2, 3]].tolist() == [1.0, 1.0, 1.0]
    none, all_left = composite(torch.zeros(0), torch.zeros(0), torch.zeros(0).long(), 3)
    assert none.shape == (0,)
    assert all_left.tolist() == [1.0, 1.0, 1.0]


def test_gradients_are_those_of_finite_differences():
    density, step_m, ray = packed(rays=6)
    values = (1 + 40 * torch.rand_like(density)).double().requires_grad_()
    steps = step_m.double()
    assert torch.autograd.gradcheck(lambda d: composite(d, steps, ray, 6), values)


def test_gradients_through_an_opaque_front_are_finite_and_vanish_behind_it():
    values = torch.tensor([1e7, 30.0, 30.0], requires_grad=True)
    weights, left = one_ray(values, 0.01)
    (weights @ torch.tensor([1.0, -5.0, 9.0]) + 3 * left).backward()
    assert torch.isfinite(values.grad).all()
    assert values.grad[1:].abs().max() < 1e-30


def test_the_order_of_rays_does_not_matter():
    density, step_m, ray = packed()
    weights, left = composite(density, step_m, ray, 30)
    order = torch.randperm(30, generator=torch.Generator().manual_seed(1))
    taken = torch.cat([(ray == index).nonzero()[:, 0] for index in order])
    place = torch.empty(30, dtype=torch.int64)
    place[order] = torch.arange(30)
    shuffled, shuffled_left = composite(density[taken], step_m[taken], place[ray[taken]], 30)
    assert shuffled.numpy() == pytest.approx(weights[taken].numpy(), abs=1e-7)
    assert shuffled_left.numpy() == pytest.approx(left[order].numpy(), abs=1e-7)


def test_sums_along_rays_are_sums_over_their_samples():
    values = torch.arange(10.0).reshape(5, 2)
    found = sum_along_rays(values, torch.tensor([0, 0, 2, 2, 2]), 4)
    assert found.tolist() == [[2.0, 4.0], [0.0, 0.0], [18.0, 21.0], [0.0, 0.0]]


def test_flags_are_counted_ray_by_ray():
    flags = torch.tensor([True, False, True, False, True, True])
    found = running_count(flags, torch.tensor([0, 0, 0, 2, 2, 2]), 3)
    assert found.tolist() == [1, 1, 2, 0, 1, 2]
