from __future__ import annotations

from flows.list_options import spread

REPEATABLE = {"--scenes", "--set"}


def test_every_value_gets_its_option():
    assert spread(["--scenes", "turn", "walk", "--seeds", "3"], REPEATABLE) == [
        *("--scenes", "turn", "--scenes", "walk"),
        *("--seeds", "3"),
    ]


def test_what_is_written_out_already_stays_as_it_is():
    written = ["--set", "a=1", "--set", "b=2", "--out", "there"]
    assert spread(written, REPEATABLE) == written


def test_an_option_of_one_value_does_not_swallow_what_follows():
    assert spread(["--out", "there", "stray"], REPEATABLE) == ["--out", "there", "stray"]
