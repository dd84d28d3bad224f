"""A run that names slots works while it holds one, and waits while there is none."""

from __future__ import annotations

import threading
import time
from contextvars import copy_context
from importlib import import_module

import pytest
from prefect.client.orchestration import get_client
from prefect.client.schemas.actions import GlobalConcurrencyLimitCreate

from flows.slots import held_slot
from mocoflow_core.errors import InputError

NAME = "one-gpu"


class StopHereError(Exception):
    """Nothing of the work itself is needed."""


@pytest.fixture(scope="module")
def taken(prefect_server):
    """How many slots of a limit of one are taken."""
    client = get_client(sync_client=True)
    client.create_global_concurrency_limit(GlobalConcurrencyLimitCreate(name=NAME, limit=1))
    return lambda: client.read_global_concurrency_limit_by_name(NAME).active_slots


@pytest.fixture
def seen(monkeypatch, taken):
    """The slots that were taken when the work began; it ends there."""
    found: list[int] = []

    def prepare(_):
        found.append(taken())
        raise StopHereError

    monkeypatch.setattr(import_module("flows.reconstruct"), "prepare", prepare)
    return found


@pytest.mark.parametrize(("slots", "held"), [(NAME, 1), (None, 0)])
def test_a_run_holds_a_slot_while_it_works(
    slots, held, reconstruct, toy_scene, tmp_path, taken, seen
):
    with pytest.raises(StopHereError):
        reconstruct(toy_scene, tmp_path / "out", slots=slots)
    assert (seen, taken()) == ([held], 0)


def test_it_waits_for_whoever_holds_the_last_one(reconstruct, toy_scene, tmp_path, seen):
    def run():
        with pytest.raises(StopHereError):
            reconstruct(toy_scene, tmp_path / "out", slots=NAME)

    with held_slot(NAME):
        waiting = threading.Thread(target=copy_context().run, args=(run,))
        waiting.start()
        end = time.monotonic() + 60.0
        while not (tmp_path / "out").is_dir() and time.monotonic() < end:
            time.sleep(0.1)
        waiting.join(1.0)
        assert waiting.is_alive()
        assert not seen
    waiting.join(60.0)
    assert not waiting.is_alive()
    assert seen == [1]


def test_slots_that_do_not_exist_are_refused_before_the_folder_is_taken(
    reconstruct, toy_scene, tmp_path
):
    with pytest.raises(InputError, match="prefect gcl create nothing-such"):
        reconstruct(toy_scene, tmp_path / "out", slots="nothing-such")
    assert not (tmp_path / "out").exists()
