from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.report.benchmark_chart import plot_benchmark, write_benchmark_chart


def seeds(level: float, count: int = 3):
    """Curves that rise by a decibel a doubling, and differ by one from seed to seed."""
    return {
        seed: [
            CurveRow("turn", "m", seed, "optimise_scene", 1, t, t, "psnr_union", value)
            for t in (1.0, 2.0, 4.0, 8.0)
            for value in [level + seed + np.log2(t)]
        ]
        for seed in range(count)
    }


MOCOFLOW = Contender("turn", "fast", "mocoflow")
PAPER = Contender("turn", "paper", "mocoflow")
OTHER_SCENE = Contender("walk", "fast", "mocoflow")
LOCAL = Contender("turn", "fast", "without_local")
MESH = Contender("turn", "fast", "posed_mesh")


def curves(axes):
    return [line for line in axes.lines if len(line.get_xdata()) > 3]


def test_each_scene_has_a_panel_with_logarithmic_axes():
    figure = plot_benchmark({MOCOFLOW: seeds(10), OTHER_SCENE: seeds(8), LOCAL: seeds(9)})
    panels = {axes.get_title(loc="left"): axes for axes in figure.axes}
    assert list(panels) == ["turn", "walk"]
    assert {len(curves(axes)) for axes in panels.values()} == {1, 2}
    for axes in panels.values():
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_the_line_is_the_median_seed_in_the_band_of_all():
    axes = plot_benchmark({MOCOFLOW: seeds(10)}).axes[0]
    [line] = curves(axes)
    np.testing.assert_allclose(line.get_ydata(), 10 ** (-(11 + np.arange(4)) / 10))
    [band] = axes.collections
    low, high = band.get_datalim(axes.transData).intervaly
    assert low == pytest.approx(10 ** (-15 / 10))
    assert high == pytest.approx(10 ** (-10 / 10))


def test_one_seed_has_no_band():
    assert not plot_benchmark({MOCOFLOW: seeds(10, count=1)}).axes[0].collections


def test_a_method_keeps_its_colour_in_every_panel_and_preset():
    runs = {LOCAL: seeds(9), MOCOFLOW: seeds(10), PAPER: seeds(11), OTHER_SCENE: seeds(8)}
    turn, walk = plot_benchmark(runs).axes
    local, fast, paper = curves(turn)
    assert fast.get_color() == paper.get_color() == curves(walk)[0].get_color()
    assert fast.get_color() != local.get_color()
    assert fast.get_linestyle() != paper.get_linestyle()


def test_the_posed_mesh_is_a_level_and_not_a_line():
    axes = plot_benchmark({MOCOFLOW: seeds(10), MESH: seeds(6)}).axes[0]
    assert len(curves(axes)) == 1
    level = 10 ** (-(6 + 1 + 3) / 10)
    assert any(np.allclose(line.get_ydata(), level) for line in axes.lines)


def test_the_picture_is_written_and_nothing_is_where_there_is_nothing(tmp_path):
    write_benchmark_chart({MOCOFLOW: seeds(10)}, tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as picture:
        assert picture.width > 600
    write_benchmark_chart({}, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()
