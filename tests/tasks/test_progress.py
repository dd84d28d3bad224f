"""How far stages are: said at every frame of those that go over all of them, shown now and then."""

from __future__ import annotations

import time
from collections import defaultdict
from contextlib import contextmanager

import pytest
from prefect import flow
from prefect.client.orchestration import get_client

from mocoflow_core.capture.extract import CaptureConfig, ClipNeeds
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.io.store import Store
from mocoflow_core.synthetic.toy import write_toy_scene
from tasks import progress
from tasks.extract_clip import extract_clip
from tasks.extract_evaluation import extract_evaluation
from tasks.progress import SECONDS_BETWEEN_UPDATES, showing_progress
from tasks.source import clip_source, evaluation_source


@pytest.fixture
def scene(tmp_path):
    write_toy_scene(tmp_path / "toy")
    return open_scene(tmp_path / "toy")


@pytest.fixture
def told(monkeypatch):
    """The fractions that the stages tell."""
    said = defaultdict(list)

    @contextmanager
    def showing(stage, note_time):
        yield lambda fraction, text: said[stage].append(fraction)

    monkeypatch.setattr("tasks.stage.showing_progress", showing)
    return said


def test_extracting_a_clip_and_other_cameras_tells_each_frame_and_never_goes_back(
    scene, told, tmp_path
):
    store, capture = Store(tmp_path / "store"), CaptureConfig(behind_person="plate")
    asked = {"recording": clip_source(scene), "capture": capture, "needs": ClipNeeds()}
    clip = extract_clip._run(store, asked)
    others = {"recording": evaluation_source(scene), "clip": clip, "capture": capture}
    extract_evaluation._run(store, others)
    frames = clip.summary["frames"]
    # Decoded, their masks, cut out.
    assert len(told["extract_clip"]) >= 3 * frames
    assert len(told["extract_evaluation"]) >= 3 * len(scene.evaluation_cameras)
    for fractions in told.values():
        assert fractions == sorted(fractions)
        assert 0 < fractions[0] < fractions[-1] == pytest.approx(1.0)


@flow
def importing():
    with showing_progress("import") as tell:
        tell(0.5, "half of it")


def test_an_import_is_shown_on_the_page_of_the_run_that_it_happens_in(prefect_server, monkeypatch):
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_UPDATES", 0.0)
    importing()
    with get_client(sync_client=True) as client:
        shown = {artifact.key: artifact for artifact in client.read_artifacts()}
    assert "half of it" in shown["import"].description


def test_telling_every_frame_costs_nothing_that_counts():
    """Of stages that take milliseconds for a frame."""
    with showing_progress("extract_clip") as tell:
        start = time.perf_counter()
        for row in range(1000):
            tell(row / 1000, f"frame {row}")
        assert time.perf_counter() - start < SECONDS_BETWEEN_UPDATES / 10
