"""A site is brought up and taken down with the server's password, and not silently without."""

from __future__ import annotations

import base64
import json
import os
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from flows.production.processes import is_running, start, stop
from flows.production.site import AUTHENTICATION, MARK, Site
from flows.production.up import bring_up, take_down
from mocoflow_core.errors import InputError

SLEEPS = [sys.executable, "-c", "import time; time.sleep(60)"]


class Answers(BaseHTTPRequestHandler):
    """As Prefect's server answers: the password is wanted for all but its health.

    Its worker has one place, and takes the next run as soon as the one before is cancelled.
    """

    secret: str | None = None

    def do_GET(self):
        sent = base64.b64encode((self.secret or "").encode()).decode()
        is_known = self.secret is None or self.headers["Authorization"] == f"Basic {sent}"
        is_ready = self.path == "/api/ready"
        self.send_response(200 if is_known or is_ready else 401)
        self.end_headers()
        self.wfile.write(json.dumps({"message": "OK"} if is_ready else self.answer()).encode())

    do_POST = do_PATCH = do_GET

    def answer(self):
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"] or 0)) or b"null")
        state = self.server
        if self.path.startswith("/api/work_pools/"):
            state.paused = asked["is_paused"]
        if self.path.endswith("/set_state"):
            state.under_way = []
        if not state.under_way and not state.paused:
            state.under_way, state.queue = state.queue[:1], state.queue[1:]
        return [{"id": run, "name": run, "parent_task_run_id": None} for run in state.under_way]

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    server.paused, server.under_way, server.queue = False, [], []
    threading.Thread(target=server.serve_forever).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def site(server, tmp_path):
    """One whose server is there and whose worker is a process that sleeps."""
    site = Site(tmp_path, server.server_port)
    site.logs.mkdir()
    site.save()
    start(site, "worker", SLEEPS, {**os.environ, MARK: str(tmp_path)})
    yield site
    stop(site, "worker")


def test_what_runs_is_cancelled_and_what_waits_is_not_begun(site, server):
    server.under_way, server.queue = ["first"], ["second", "third"]
    said = list(take_down(site, grace_s=1.0))
    assert said == ["1 runs cancelled: first", "worker stopped"]
    assert server.queue == ["second", "third"]


def test_without_the_password_processes_end_and_it_is_said_that_no_run_was_cancelled(
    site, monkeypatch
):
    monkeypatch.setattr(Answers, "secret", "me:secret")
    monkeypatch.delenv(AUTHENTICATION, raising=False)
    said = list(take_down(site))
    assert "without being cancelled: HTTP Error 401" in said[0]
    assert AUTHENTICATION in said[0]
    assert said[1:] == ["worker stopped"]
    assert not is_running(site, "worker")


def test_without_a_server_processes_end_and_it_is_said_that_no_run_was_cancelled(site):
    said = list(take_down(Site(site.folder, 9)))
    assert "without being cancelled" in said[0]
    assert said[1:] == ["worker stopped"]


@pytest.mark.parametrize(
    ("running", "asked"),
    [(None, "me:secret"), ("me:secret", None), ("me:secret", ""), ("me:secret", "me:other")],
)
def test_a_running_server_keeps_its_password_and_it_is_said(running, asked, site, monkeypatch):
    stop(site, "worker")
    monkeypatch.setattr("flows.production.up.is_running", lambda _, name: name == "server")
    monkeypatch.setattr(Answers, "secret", running)
    monkeypatch.delenv(AUTHENTICATION, raising=False)
    if asked is not None:
        monkeypatch.setenv(AUTHENTICATION, asked)
    with pytest.raises(InputError, match=f"{AUTHENTICATION} that the running .* make down"):
        list(bring_up(site))
