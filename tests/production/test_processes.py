"""Processes outlive the command that started them and are found, ended and not mistaken."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from flows.production.processes import end_what_is_left, is_running, start, stop
from flows.production.site import MARK, Site

SLEEPS = [sys.executable, "-c", "import time; time.sleep(60)"]
DEAF = [
    sys.executable,
    "-c",
    "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(1, flush=True); "
    "time.sleep(60)",
]
HAS_PROC = Path("/proc/self/environ").exists()


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    site.logs.mkdir()
    yield site
    for name in ("one", "other"):
        stop(site, name, grace_s=0.1)


def environment(site):
    return {**os.environ, MARK: str(site.folder)}


def test_a_process_runs_until_it_is_stopped(site):
    assert not is_running(site, "one")
    start(site, "one", SLEEPS, environment(site))
    assert is_running(site, "one")
    assert stop(site, "one")
    assert not is_running(site, "one")
    assert not stop(site, "one")


def test_one_that_ignores_being_told_is_killed(site):
    process = start(site, "one", DEAF, environment(site))
    end = time.monotonic() + 20.0
    while not (site.logs / "one.log").read_text() and time.monotonic() < end:
        time.sleep(0.05)
    assert stop(site, "one", grace_s=0.3)
    assert process.wait() == -signal.SIGKILL


def test_another_process_with_the_same_id_is_left_alone(site):
    site.pid_file("one").write_text(f"{os.getpid()} some other time\n")
    assert not is_running(site, "one")
    assert not stop(site, "one")


def test_a_process_that_has_ended_by_itself_is_not_running(site):
    process = start(site, "one", [sys.executable, "-c", ""], environment(site))
    process.wait()
    assert not is_running(site, "one")


def test_a_process_is_found_again_from_another_time_zone(site, monkeypatch):
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    start(site, "one", SLEEPS, environment(site))
    monkeypatch.setenv("TZ", "America/New_York")
    assert is_running(site, "one")
    assert stop(site, "one")


@pytest.mark.skipif(not HAS_PROC, reason="this system does not show environments of processes")
def test_what_was_left_behind_is_found_and_ended(site, tmp_path):
    process = start(site, "one", SLEEPS, environment(site))
    site.pid_file("one").unlink()
    elsewhere = Site(tmp_path / "elsewhere")
    assert end_what_is_left(elsewhere) == []
    assert process.poll() is None
    assert end_what_is_left(site) == [process.pid]
    assert process.wait() != 0
