from __future__ import annotations

import pytest

from flows.benchmark_scenes import read_scenes
from mocoflow_core.methods.ablations import SETTINGS, require_method
from mocoflow_core.methods.experiments import EXPERIMENTS
from mocoflow_core.presets import PRESETS


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_cell_of_an_experiment_makes_sense(name):
    experiment = EXPERIMENTS[name]
    assert read_scenes(experiment.scenes)
    for preset in experiment.presets:
        for method in experiment.methods:
            if method in SETTINGS:
                require_method(method, PRESETS[preset](), experiment.settings)


@pytest.mark.parametrize("name", [n for n, e in EXPERIMENTS.items() if not e.shifts_views])
def test_every_experiment_that_learns_has_the_mesh_estimate_beside_it(name):
    assert "posed_mesh" in EXPERIMENTS[name].methods
