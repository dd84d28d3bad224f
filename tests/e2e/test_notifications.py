"""People are told of a night that failed and of one that is worse than those before."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from mocoflow_core.metrics.history import FEWEST_NIGHTS
from tests.e2e.production import ROOT
from tests.e2e.test_deployed_runs import ENDED

pytestmark = pytest.mark.cluster

BLOCK = """
import sys
from prefect.blocks.notifications import CustomWebhookNotificationBlock as Webhook
text = {"subject": "{{subject}}", "body": "{{body}}"}
Webhook(name="ops", url=sys.argv[1], json_data=text).save("ops", overwrite=True)
"""


@pytest.fixture(scope="module")
def told() -> Iterator[tuple[str, list[dict]]]:
    """The address of a web hook, and what it was told."""
    messages: list[dict] = []

    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            messages.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *words: object) -> None:
            """Nothing is printed."""

    server = HTTPServer(("127.0.0.1", 0), Hook)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/", messages
    server.shutdown()


def python(made, *words: str, **variables: str) -> str:
    done = subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=made.environment | variables,
        capture_output=True,
        text=True,
        timeout=300.0,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def watched(deployed, told) -> Iterator[list[dict]]:
    """What people are told while a block is named for it."""
    address, messages = told
    python(deployed, "-c", BLOCK, address)
    named = {"MOCOFLOW_NOTIFICATION_BLOCK": "custom-webhook/ops"}
    said = python(deployed, "-m", "flows.production", "deploy", **named)
    assert "told through custom-webhook/ops" in said
    yield messages
    said = python(deployed, "-m", "flows.production", "deploy")
    assert "nobody is told" in said
    names = {automation["name"] for automation in deployed.ask("/automations/filter", {})}
    assert names == {"crash-runs-without-heartbeat"}


def run_benchmark(made, scene, out) -> str:
    parameters = {"scenes": [str(scene)], "methods": ["mocoflow"], "presets": ["toy"], "seeds": 1}
    asked = {"out": str(out), "settings": ["person_scores.use=off"], "afresh": False}
    return made.start("benchmark/synthetic", **parameters, **asked)


def wait_for_message(messages: list[dict], text: str) -> dict:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        for message in messages:
            if text in message["body"]:
                return message
        time.sleep(0.5)
    raise AssertionError(f"nobody was told of {text!r}: {messages}")


def test_people_are_told_of_a_benchmark_of_which_nothing_finished(deployed, watched, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "scene.json").write_text("{")
    run = run_benchmark(deployed, broken, tmp_path / "night")
    assert deployed.wait(run, *ENDED, within_s=300.0) == "FAILED"
    message = wait_for_message(watched, "none of 1 runs finished")
    assert message["subject"] == "benchmark Failed"
    assert run in message["body"]  # The address of its page.


def test_people_are_told_of_a_benchmark_that_is_worse_than_its_last_nights(
    deployed, watched, scene, tmp_path
):
    run = run_benchmark(deployed, scene, tmp_path / "night0")
    assert deployed.wait(run, *ENDED, within_s=300.0) == "COMPLETED", deployed.logs(run)
    for night in range(1, FEWEST_NIGHTS):
        shutil.copytree(tmp_path / "night0", tmp_path / f"night{night}")
    for night in range(FEWEST_NIGHTS):
        file = tmp_path / f"night{night}" / "benchmark.json"
        record = json.loads(file.read_text())
        for row in record["summary"]:
            row["mean"] += 5.0 if row["metric"] == "psnr_union" else 0.0
        file.write_text(json.dumps(record | {"finished_at": f"2026-01-0{night + 1}T01:00:00"}))
    run = run_benchmark(deployed, scene, tmp_path / "tonight")
    assert deployed.wait(run, *ENDED, within_s=300.0) == "COMPLETED", deployed.logs(run)
    message = wait_for_message(watched, "PSNR, person: ")
    assert str(tmp_path / "tonight/benchmark.html") in message["body"]
    assert "worse than usual" in message["subject"]
    assert "PSNR, person" in deployed.artifacts(run)["benchmark"]
