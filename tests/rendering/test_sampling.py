from __future__ import annotations

import pytest
import torch

from mocoflow_core.geometry.rays import Rays
from mocoflow_core.rendering.sampling import PackedSamples, march

STEP = 0.02


def rays(count: int) -> Rays:
    generator = torch.Generator().manual_seed(0)
    directions = torch.randn(count, 3, generator=generator)
    origins = torch.randn(count, 3, generator=generator)
    return Rays(origins, torch.nn.functional.normalize(directions, dim=-1))


def borders(count: int) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    near = 2 * torch.rand(count, generator=generator)
    return near, near + torch.rand(count, generator=generator)


def all_of(points: torch.Tensor, ray: torch.Tensor) -> torch.Tensor:
    return torch.ones(len(points), dtype=torch.bool)


def marched(count: int = 60, jitter: float = 0.5, keep=all_of) -> PackedSamples:
    return march(rays(count), *borders(count), STEP, torch.full((count,), jitter), keep)


def distances(samples: PackedSamples, through: Rays) -> torch.Tensor:
    return ((samples.points - through.origins[samples.ray]) * through.directions[samples.ray]).sum(
        -1
    )


@pytest.mark.parametrize("jitter", [0.0, 0.5, 0.999])
def test_samples_lie_on_their_rays_between_near_and_far(jitter):
    samples, (near, far) = marched(jitter=jitter), borders(60)
    distance = distances(samples, rays(60))
    assert samples.points.numpy() == pytest.approx(
        rays(60).select(samples.ray).at(distance).numpy(), abs=1e-5
    )
    assert (distance >= near[samples.ray] - 1e-5).all()
    # A last step that is cut short may carry its sample beyond far by less than itself.
    assert (distance < far[samples.ray] + STEP).all()


@pytest.mark.parametrize("jitter", [0.0, 0.5, 0.999])
def test_steps_sum_to_the_length_within_a_step(jitter):
    samples, (near, far) = marched(jitter=jitter), borders(60)
    length = torch.zeros(60).index_add(0, samples.ray, samples.step_m)
    assert (length - (far - near)).abs().max() <= STEP + 1e-5


def test_samples_are_sorted_by_ray_and_distance_one_step_apart():
    samples = marched()
    assert (samples.ray.diff() >= 0).all()
    gaps = distances(samples, rays(60)).diff()[samples.ray.diff() == 0]
    assert gaps.numpy() == pytest.approx(STEP, abs=1e-5)


def test_the_same_jitter_gives_the_same_samples():
    first, second = marched(), marched()
    assert torch.equal(first.points, second.points)
    assert not torch.equal(first.points, marched(jitter=0.3).points)


def test_a_ray_that_misses_gets_no_samples():
    near, far = torch.tensor([1.0, 2.0, 3.0, 0.0]), torch.tensor([1.5, 2.0, -1.0, -torch.inf])
    samples = march(rays(4), near, far, STEP, torch.full((4,), 0.5), all_of)
    assert set(samples.ray.tolist()) == {0}
    assert len(samples) == 25


def test_no_rays_are_no_error():
    none = Rays(torch.zeros(0, 3), torch.zeros(0, 3))
    assert len(march(none, torch.zeros(0), torch.zeros(0), STEP, torch.zeros(0), all_of)) == 0


def test_only_what_is_wanted_is_kept():
    def above(points, ray):
        return points[:, 2] > 0

    everything, kept = marched(), marched(keep=above)
    wanted = everything.points[:, 2] > 0
    assert torch.equal(kept.points, everything.points[wanted])
    assert torch.equal(kept.ray, everything.ray[wanted])
    assert 0 < len(kept) < len(everything)


def test_each_ray_has_its_own_near_and_far():
    # One pair for the whole image would cut the nearest part of the body.
    near, far = torch.tensor([1.0, 2.5]), torch.tensor([1.2, 2.7])
    samples = march(rays(2), near, far, STEP, torch.full((2,), 0.5), all_of)
    distance = distances(samples, rays(2))
    assert float(distance[samples.ray == 0].min()) == pytest.approx(1.01, abs=1e-5)
    assert float(distance[samples.ray == 1].min()) == pytest.approx(2.51, abs=1e-5)
