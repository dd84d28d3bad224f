from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.curve import CurveRow, StageSpan
from mocoflow_core.report.curve_plot import plot_curve, svg_of

SPANS = [StageSpan("extract_clip", 0.0, 2.0), StageSpan("optimise_scene", 2.0, 20.0)]


def rows(seed: int, offset: float = 0.0) -> list[CurveRow]:
    return [
        CurveRow("s", "mocoflow", seed, "optimise_scene", 10, t, 2 * t, metric, value + offset)
        for t in (3.0, 6.0, 12.0)
        for metric, value in (("psnr_union", 15 + np.log(t)), ("odd_metric", 1 / t))
    ]


def wall_line(axes) -> np.ndarray:
    return next(line.get_xydata() for line in axes.lines if line.get_marker() == "o")


def test_the_line_is_the_mean_squared_error_over_wall_seconds() -> None:
    axes = plot_curve(rows(0), SPANS).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    seconds, error = wall_line(axes).T
    np.testing.assert_allclose(seconds, [3, 6, 12])
    np.testing.assert_allclose(error, 10 ** (-(15 + np.log(seconds)) / 10))


def test_several_seeds_are_drawn_as_their_median_with_their_range() -> None:
    many = [row for seed, offset in ((0, -1), (1, 0), (2, 3)) for row in rows(seed, offset)]
    axes = plot_curve(many, SPANS).axes[0]
    alone = plot_curve(rows(1), SPANS).axes[0]
    np.testing.assert_allclose(wall_line(axes), wall_line(alone))
    assert len(axes.collections) == len(alone.collections) + 1


def test_every_stage_that_can_be_seen_is_shaded() -> None:
    axes = plot_curve(rows(0), SPANS).axes[0]
    ends = sorted(round(patch.get_x() + patch.get_width(), 6) for patch in axes.patches)
    assert ends == [2.0, 20.0]
    assert axes.get_xlim()[0] < 2.0
    assert axes.get_xlim()[1] > 24.0


def test_the_baseline_is_a_level_at_its_error() -> None:
    axes = plot_curve(rows(0), SPANS, {"psnr_union": 10.0}).axes[0]
    assert any(np.allclose(line.get_ydata(), 0.1) for line in axes.lines)


def test_nothing_to_draw_is_no_figure() -> None:
    assert plot_curve([], SPANS) is None


def test_metrics_without_a_panel_are_drawn_when_there_are_no_others() -> None:
    odd = [row for row in rows(0) if row.metric == "odd_metric"]
    assert plot_curve(odd, []).axes[0].get_title(loc="left") == "odd_metric"


def test_the_picture_is_text_and_depends_on_nothing_but_its_data() -> None:
    first, second = (svg_of(plot_curve(rows(0), SPANS)) for _ in range(2))
    assert first == second
    assert first.startswith("<svg")
    assert "seconds of the training clock" in first


@pytest.mark.parametrize("value", [1.0, 0.0])
def test_a_perfect_or_useless_score_does_not_break_the_log_axes(value: float) -> None:
    flat = [CurveRow("s", "m", 0, "st", 1, 1.0, 1.0, "ssim", value)]
    assert "<svg" in svg_of(plot_curve(flat, []))


def test_what_networks_say_has_a_line_of_its_own() -> None:
    networks = [
        row._replace(metric=metric, value=0.5)
        for row in rows(0)[::2]
        for metric in ("lpips_alex", "oks")
    ]
    figure = plot_curve([*rows(0), *networks], SPANS)
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.axison]
    assert titles == ["PSNR, person", "LPIPS", "OKS"]
    assert figure.get_size_inches()[1] == 2 * plot_curve(rows(0), SPANS).get_size_inches()[1]
