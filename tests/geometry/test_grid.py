from __future__ import annotations

import pytest
import torch

from mocoflow_core.geometry.grid import SparseGrids, weighted_rows

SPACING = 0.5


def grids(occupied: list[torch.Tensor], origins: list[list[float]]) -> SparseGrids:
    """Grids from boolean lattices; nodes are numbered one grid after the other."""
    flat = torch.cat([lattice.flatten() for lattice in occupied])
    numbers = torch.cumsum(flat, 0) - 1
    sizes = torch.tensor([lattice.numel() for lattice in occupied])
    return SparseGrids(
        torch.tensor(origins, dtype=torch.float64),
        torch.tensor([lattice.shape for lattice in occupied]),
        torch.cumsum(sizes, 0) - sizes,
        torch.where(flat, numbers, -1).int(),
        SPACING,
    )


def full(shape: tuple[int, int, int]) -> torch.Tensor:
    return torch.ones(shape, dtype=torch.bool)


def island(shape: tuple[int, int, int]) -> torch.Tensor:
    """Occupied everywhere but on the border."""
    lattice = torch.zeros(shape, dtype=torch.bool)
    lattice[1:-1, 1:-1, 1:-1] = True
    return lattice


def node_positions(lattice: torch.Tensor, origin: list[float]) -> torch.Tensor:
    return torch.tensor(origin, dtype=torch.float64) + SPACING * lattice.nonzero()


def linear(points: torch.Tensor) -> torch.Tensor:
    return points @ torch.tensor([2.0, -1.0, 0.5], dtype=torch.float64) + 3.0


def random_points(count: int, low: float, high: float, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return low + (high - low) * torch.rand(count, 3, generator=generator, dtype=torch.float64)


def test_linear_functions_are_reproduced_where_all_corners_exist():
    lattices, origins = [full((4, 5, 6)), full((5, 3, 4))], [[0.0, 1.0, -2.0], [7.0, -1.0, 0.5]]
    both = grids(lattices, origins)
    pairs = zip(lattices, origins, strict=True)
    table = linear(torch.cat([node_positions(*pair) for pair in pairs]))
    for grid, lattice in enumerate(lattices):
        size = SPACING * (torch.tensor(lattice.shape) - 1)
        points = both.origin[grid] + size * random_points(200, 0, 1)
        numbers, weights = both.corners(points, torch.full((200,), grid))
        found = (table[numbers] * weights).sum(-1)
        assert found.numpy() == pytest.approx(linear(points).numpy(), abs=1e-12)


def test_weights_sum_to_one_or_are_all_zero():
    lattice = torch.rand(6, 6, 6, generator=torch.Generator().manual_seed(1)) > 0.8
    sparse = grids([lattice], [[0.0, 0.0, 0.0]])
    points = random_points(2000, -1.0, 3.5)
    numbers, weights = sparse.corners(points, torch.zeros(2000, dtype=torch.int64))
    total = weights.sum(-1)
    known = total > 0
    assert total[known].numpy() == pytest.approx(1.0, abs=1e-12)
    assert (weights >= 0).all()
    assert 0 < int(known.sum()) < 2000
    assert (numbers >= 0).all()
    assert (numbers < lattice.sum()).all()


def test_missing_corners_carry_no_weight():
    lattice = full((2, 2, 2))
    lattice[0, 0, 0] = False
    sparse = grids([lattice], [[0.0, 0.0, 0.0]])
    table = torch.full((7, 1), 5.0, dtype=torch.float64)
    points = random_points(50, 0.01, 0.49)
    found = weighted_rows(table, *sparse.corners(points, torch.zeros(50, dtype=torch.int64)))
    # The rest is scaled up, so a constant stays what it is beside the hole.
    assert found.numpy() == pytest.approx(5.0)


def test_points_outside_are_unknown():
    sparse = grids([island((5, 5, 5))], [[0.0, 0.0, 0.0]])
    outside = torch.tensor(
        [[-0.3, 1, 1], [2.4, 1, 1], [1, 1, 50.0], [-9.0, -9, -9], [1e6, 1e6, 1e6]]
    ).double()
    _, weights = sparse.corners(outside, torch.zeros(5, dtype=torch.int64))
    assert (weights == 0).all()


def test_a_point_on_a_node_takes_that_node_alone():
    lattice = island((5, 6, 5))
    sparse = grids([lattice], [[1.0, 2.0, 3.0]])
    positions = node_positions(lattice, [1.0, 2.0, 3.0])
    numbers, weights = sparse.corners(positions, torch.zeros(len(positions), dtype=torch.int64))
    found = (numbers * weights).sum(-1)
    assert found.numpy() == pytest.approx(torch.arange(len(positions)).numpy())
    nearest = sparse.flat_nearest(positions, torch.zeros(len(positions), dtype=torch.int64))
    assert torch.equal(sparse.node_map[nearest].long(), torch.arange(len(positions)))


def test_the_interpolation_is_continuous_across_cells():
    sparse = grids([full((5, 5, 5))], [[0.0, 0.0, 0.0]])
    table = torch.randn(125, 2, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    one_grid = torch.zeros(20, dtype=torch.int64)
    on_face = random_points(20, 0.1, 1.9)
    on_face[:, 1] = 1.0
    step = torch.tensor([0.0, 1e-9, 0.0], dtype=torch.float64)
    before = weighted_rows(table, *sparse.corners(on_face - step, one_grid))
    after = weighted_rows(table, *sparse.corners(on_face + step, one_grid))
    assert before.numpy() == pytest.approx(after.numpy(), abs=1e-7)


def test_the_gradient_of_weighted_rows_is_that_of_the_plain_expression():
    generator = torch.Generator().manual_seed(3)
    table = torch.randn(6, 4, generator=generator, dtype=torch.float64, requires_grad=True)
    weights = torch.rand(5, 8, generator=generator, dtype=torch.float64, requires_grad=True)
    numbers = torch.randint(6, (5, 8), generator=generator)
    assert torch.autograd.gradcheck(lambda t, w: weighted_rows(t, numbers, w), (table, weights))
    plain = (table[numbers] * weights[..., None]).sum(1)
    found = weighted_rows(table, numbers, weights)
    assert found.detach().numpy() == pytest.approx(plain.detach().numpy())
    upstream = torch.randn(5, 4, generator=generator, dtype=torch.float64)
    expected = torch.autograd.grad(plain, (table, weights), upstream)
    for ours, theirs in zip(
        torch.autograd.grad(found, (table, weights), upstream), expected, strict=True
    ):
        assert ours.numpy() == pytest.approx(theirs.numpy(), abs=1e-13)


def test_gradients_reach_the_points_through_the_weights():
    sparse = grids([full((4, 4, 4))], [[0.0, 0.0, 0.0]])
    table = torch.randn(64, 3, generator=torch.Generator().manual_seed(4), dtype=torch.float64)
    points = random_points(10, 0.05, 1.45).requires_grad_()
    one_grid = torch.zeros(10, dtype=torch.int64)
    assert torch.autograd.gradcheck(
        lambda p: weighted_rows(table, *sparse.corners(p, one_grid)), points
    )


def test_points_that_are_no_numbers_are_seen_in_the_weights_and_crash_nothing():
    sparse = grids([full((4, 4, 4))], [[0.0, 0.0, 0.0]])
    points = torch.full((3, 3), torch.nan)
    points[1:, 1:] = 0.6
    points[2, 0] = torch.inf
    one_grid = torch.zeros(3, dtype=torch.int64)
    numbers, weights = sparse.corners(points, one_grid)
    assert ((numbers >= 0) & (numbers < 64)).all()
    assert torch.isnan(weights[:2]).all(-1).tolist() == [True, True]
    assert sparse.flat_nearest(points, one_grid).min() >= 0


def test_no_points_are_no_error():
    sparse = grids([full((3, 3, 3))], [[0.0, 0.0, 0.0]])
    table = torch.ones(27, 2, requires_grad=True)
    numbers, weights = sparse.corners(torch.zeros(0, 3), torch.zeros(0, dtype=torch.int64))
    found = weighted_rows(table, numbers, weights.float())
    assert found.shape == (0, 2)
    found.sum().backward()
    assert torch.equal(table.grad, torch.zeros(27, 2))


def test_saved_tensors_make_the_same_grids():
    before = grids([full((3, 4, 2)), island((4, 4, 4))], [[0.0, 0, 0], [1.0, 1, 1]])
    after = SparseGrids.from_tensors(before.tensors())
    assert after.count == before.count == 2
    points, grid = random_points(100, -0.5, 3), torch.arange(100) % 2
    for ours, theirs in zip(after.corners(points, grid), before.corners(points, grid), strict=True):
        assert torch.equal(ours, theirs)


def test_boxes_contain_every_node():
    lattice = full((3, 4, 2))
    lower, upper = grids([lattice], [[1.0, -2.0, 0.0]]).boxes()
    positions = node_positions(lattice, [1.0, -2.0, 0.0])
    assert torch.equal(positions.amin(0), lower[0])
    assert torch.equal(positions.amax(0), upper[0])


def test_grids_that_are_shared_answer_like_the_one_they_are():
    shape = torch.tensor([[2, 2, 2]])
    numbers = torch.arange(8, dtype=torch.int32)
    one = SparseGrids(torch.zeros(1, 3), shape, torch.zeros(1, dtype=torch.int64), numbers, 1.0)
    points = torch.rand(20, 3, generator=torch.Generator().manual_seed(0))
    nodes, weights = one.corners(points, torch.zeros(20, dtype=torch.int64))
    shared = one.shared_by(4)
    assert shared.count == 4
    of_any, weights_of_any = shared.corners(points, torch.arange(20) % 4)
    assert torch.equal(of_any, nodes)
    assert torch.equal(weights_of_any, weights)
