from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocoflow_core.threads import share_of


@given(st.sets(st.integers(0, 200), min_size=1), st.integers(1, 40))
def test_shares_are_all_of_the_cores_and_differ_by_one_at_most(cores, of):
    shares = [share_of(cores, index, of) for index in range(of)]
    assert set().union(*shares) == cores if of <= len(cores) else set().union(*shares) <= cores
    sizes = [len(share) for share in shares]
    assert min(sizes) >= 1
    assert max(sizes) - min(sizes) <= 1
    if of <= len(cores):
        assert sum(sizes) == len(cores)


@pytest.mark.parametrize(
    ("of", "shares"), [(1, [{0, 1}]), (2, [{0}, {1}]), (4, [{0}, {0}, {1}, {1}])]
)
def test_more_processes_than_cores_sit_on_them_evenly(of, shares):
    assert [share_of({0, 1}, index, of) for index in range(of)] == shares
