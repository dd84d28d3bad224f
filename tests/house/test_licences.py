"""Every package that the installation pins is listed with a licence that may be used."""

from __future__ import annotations

import pytest

from docs.licences import COPYLEFT, PAGE, REMARKS, UNKNOWN, licensed, page, pinned

REMEDY = "python -m docs.licences"


@pytest.fixture(scope="module")
def rows():
    return {row.name: row for row in licensed()}


def test_the_page_is_what_the_installed_packages_say():
    assert PAGE.read_text(encoding="utf-8") == page(), REMEDY


def test_every_pinned_package_is_listed_in_its_version(rows):
    assert {name: row.version for name, row in rows.items()} == pinned(), REMEDY


def test_every_licence_is_known(rows):
    assert [name for name, row in rows.items() if row.licence in ("", UNKNOWN)] == []


def test_copyleft_has_a_remark_that_says_why_it_may_be_used(rows):
    copyleft = [name for name, row in rows.items() if COPYLEFT.search(row.licence)]
    assert copyleft
    assert [name for name in copyleft if not rows[name].remark] == []


def test_a_remark_is_of_a_package_that_is_still_there(rows):
    assert REMARKS.keys() <= rows.keys()
