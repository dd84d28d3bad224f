"""Motion consensus: both directions of the motion have to agree, at one moment and across two."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

# Points (P, 3) of moments (P,) -> moved points (P, 3) and where they are known (P,).
Move = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]
# How many points there are in all, where these are some of them.
Count = Callable[[Tensor], Tensor]


def these_alone(count: Tensor) -> Tensor:
    """Nobody else has points that belong to the same mean."""
    return count


def local_consensus(
    to_canonical: Move,
    to_observed: Move,
    points: Tensor,
    row: Tensor,
    mapped: tuple[Tensor, Tensor] | None = None,
    in_all: Count = these_alone,
) -> Tensor:
    """``|to_observed(to_canonical(x, t_i), t_i) - x|``, L1 over axes, mean over points, metres.

    An empty selection gives exactly 0. ``mapped`` is ``to_canonical`` of the points, where the
    caller has it already. Where other processes have points too, their values add up to the mean
    over all. Source: MoCo-Flow eq. 3.
    """
    canonical, known = mapped or to_canonical(points, row)
    back, known_back = to_observed(canonical, row)
    return _mean_l1(back - points, known & known_back, in_all)


def global_consensus(
    to_canonical: Move,
    to_observed: Move,
    points: Tensor,
    row: Tensor,
    other_row: Tensor,
    mapped: tuple[Tensor, Tensor] | None = None,
    in_all: Count = these_alone,
) -> Tensor:
    """The chain through another moment t_j and back to x; L1 over axes, mean, metres.

    ``to_observed(to_canonical(to_observed(to_canonical(x, t_i), t_j), t_j), t_i) - x``.
    Source: MoCo-Flow eq. 2.
    """
    canonical, known = mapped or to_canonical(points, row)
    elsewhere, known_1 = to_observed(canonical, other_row)
    canonical_again, known_2 = to_canonical(elsewhere, other_row)
    back, known_3 = to_observed(canonical_again, row)
    return _mean_l1(back - points, known & known_1 & known_2 & known_3, in_all)


def _mean_l1(difference: Tensor, known: Tensor, in_all: Count) -> Tensor:
    # Half precision holds neither the sum of many metres nor the count of many points.
    wide = torch.promote_types(difference.dtype, torch.float32)
    summed = (difference.abs().sum(-1, dtype=wide) * known).sum()
    return summed / in_all(known.sum()).clamp_min(1).to(wide)
