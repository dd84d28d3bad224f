"""Which errors the repair expects: those of a place that was given, or that was searched."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from mocoflow_core.artifacts import LocationArtifact, MeshArtifact
from mocoflow_core.body.repair import RepairConfig
from tasks import repair_body as module

KEY = {"key": "0" * 40, "wall_s": 0.0, "cpu_s": 0.0}


class Expected(Exception):
    """Carries the configuration that the repair was called with."""


@pytest.mark.parametrize(
    ("bodies", "expected"),
    [
        (MeshArtifact(**KEY), RepairConfig()),
        (LocationArtifact(**KEY, summary={"adopted": False}), RepairConfig()),
        (LocationArtifact(**KEY, summary={"adopted": True}), RepairConfig().after_search()),
    ],
)
def test_a_place_that_was_searched_has_errors_of_its_own(bodies, expected, monkeypatch, tmp_path):
    def repair(clip, meshes, configuration, force, progress):
        raise Expected(configuration)

    monkeypatch.setattr(module, "repair_where_needed", repair)
    monkeypatch.setattr(module.Clip, "load", lambda folder: None)
    monkeypatch.setattr(module.MeshSequence, "load", lambda path: None)
    work = SimpleNamespace(open=lambda artifact: tmp_path, folder=tmp_path, progress=None)
    with pytest.raises(Expected) as raised:
        module.repair_body.body(work, None, bodies, RepairConfig(), "auto")
    assert raised.value.args == (expected,)
