"""The quick part of the catalogue, and what every entry of it must be."""

from __future__ import annotations

import math

import pytest
import torch

from mocoflow_core.errors import InputError
from mocoflow_core.stability import compositing, se3
from mocoflow_core.stability.catalogue import AREAS, about, cases_of, require_areas
from mocoflow_core.stability.measurement import measure_case

QUICK = [(area, case) for area in AREAS for case in cases_of(area, quick_only=True)]
ALL = [(area, case) for area in AREAS for case in AREAS[area]]


def name_of(entry) -> str:
    return entry if isinstance(entry, str) else entry.name


@pytest.mark.parametrize(("area", "case"), QUICK, ids=name_of)
def test_a_case_stays_within_its_bound(area, case):
    failed = [row for row in measure_case(area, case) if not row.passed]
    assert failed == []


def test_names_are_unique_within_their_area():
    for area, cases in AREAS.items():
        names = [case.name for case in cases]
        assert len(set(names)) == len(names), area


@pytest.mark.parametrize(("area", "case"), ALL, ids=name_of)
def test_every_entry_says_what_is_stiff_against_what_and_why_its_bound(area, case):
    assert min(map(len, (case.stiff, case.reference, case.reason, case.parameter))) > 3
    assert len(set(case.values)) == len(case.values) > 0
    assert all(0 <= case.bound_at(value) < math.inf for value in case.values)


def test_every_area_says_what_it_is_about():
    assert all(about(area).endswith(".") for area in AREAS)


def test_no_name_means_all_areas_and_an_unknown_one_is_refused():
    assert require_areas(()) == tuple(AREAS)
    assert require_areas(("mesh", "se3", "mesh")) == ("mesh", "se3")
    with pytest.raises(InputError, match="se3"):
        require_areas(("se4",))


def exp_by_division(twist):
    """Rodrigues' formula as it stands in books."""
    omega, v = twist.split(3, -1)
    angle = omega.norm()
    zero = torch.zeros((), dtype=twist.dtype)
    x, y, z = omega
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    identity = torch.eye(3, dtype=twist.dtype)
    a, b, c = (
        torch.sin(angle) / angle,
        (1 - torch.cos(angle)) / angle**2,
        (angle - torch.sin(angle)) / angle**3,
    )
    return identity + a * cross + b * cross @ cross, (identity + b * cross + c * cross @ cross) @ v


def failures(area: str, name: str):
    (case,) = (case for case in AREAS[area] if case.name == name)
    return [row for row in measure_case(area, case) if not row.passed]


def test_an_exponential_that_divides_by_the_angle_fails(monkeypatch):
    monkeypatch.setattr(se3, "exp_se3", exp_by_division)
    failed = failures("se3", "exponential")
    # 0 / 0 at zero; at 1e-8 a difference of equal numbers over its cube.
    assert {"0", "1e-08"} <= {row.value for row in failed}
    assert any(not row.finite for row in failed)
    # Where nothing is stiff it is right: the case tells stiff from wrong.
    assert "1" not in {row.value for row in failed}


def test_a_compositing_that_loses_light_fails(monkeypatch):
    honest = compositing.composite

    def dimmed(*arguments):
        weights, transmittance = honest(*arguments)
        return 0.999 * weights, transmittance

    monkeypatch.setattr(compositing, "composite", dimmed)
    assert failures("compositing", "uniform_density")
