"""The traps that docs/datasets and docs/estimators.md list are covered by tests of those names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[2] / "docs/datasets"
TESTS = Path(__file__).parent


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.stem)
def test_every_test_that_a_page_names_exists(page):
    for file, name in re.findall(r"`(test_\w+\.py)::(\w+)`", page.read_text()):
        assert re.search(rf"^def {name}\(", (TESTS / file).read_text(), re.M), (file, name)


def test_every_test_that_the_estimators_page_names_exists():
    root = Path(__file__).parents[2]
    names = {
        path.stem: set(re.findall(r"^def (test_\w+)\(", path.read_text(), re.M))
        for path in (root / "tests").rglob("test_*.py")
    }
    everywhere = set().union(*names.values())
    page = (root / "docs/estimators.md").read_text()
    named = re.findall(r"`(?:[\w/]+/)?(test_\w+)(\.py)?(?:::(test_\w+))?`", page)
    assert len(named) > 60
    for first, is_file, name in named:
        if name:
            assert name in names[first], (first, name)
        else:
            assert first in (names if is_file else everywhere), first
