"""The traps that docs/datasets lists are covered by tests of those names."""

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
