"""The work-precision study: its sweeps, its yardstick, its verdicts and what it writes."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import work_precision
from benchmarks.knobs import BUDGETS_S, DEFAULT, KNOBS, budget, together
from benchmarks.precision_chart import sweep_seeds, write_chart
from benchmarks.precision_document import write_document
from benchmarks.precision_front import beats_default, default_of, gain_db, verdict
from benchmarks.precision_rows import Point, Row, points_of, read_rows, write_rows
from benchmarks.scene_study import Trained
from benchmarks.work_precision import Study
from mocoflow_core.presets import fast
from mocoflow_core.training.clock import Seconds


def _row(knob="default", value="", cpu_s=20.0, psnr=20.0, scene="turn", seed=0):
    """A run whose preparation took 4 s of ``cpu_s``."""
    return Row(scene, knob, value, "", seed, 750, 768, 4.0, cpu_s - 4.0, psnr, 0.97)


def _point(**values) -> Point:
    return points_of([_row(**values)])[0]


@pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)
def test_the_sweep_of_a_knob_goes_through_the_defaults_on_both_sides_or_from_one_end(knob):
    defaults = [setting.is_default for setting in knob.settings]
    assert sum(defaults) == 1
    assert len(knob.settings) >= 2
    assert set(knob.usual) <= {setting.value for setting in knob.chosen(whole=True)}


def test_settings_together_change_what_each_changes_alone():
    rays, samples = KNOBS[1].settings[0], KNOBS[2].settings[0]
    both = together((rays, samples)).configuration
    assert both.schedule == rays.configuration.schedule != fast().schedule
    assert both.sampling == samples.configuration.sampling != fast().sampling


def test_a_budget_changes_nothing_but_the_budget():
    configuration = budget(BUDGETS_S[0]).configuration
    unlimited = configuration.schedule.model_copy(update={"budget_s": None})
    assert configuration.schedule.budget_s == BUDGETS_S[0]
    assert configuration.model_copy(update={"schedule": unlimited}) == fast()


class Prepared:
    """A scene whose optimisation is done at once."""

    spent = Seconds(3.0, 4.0)

    def __init__(self, scene, configuration):
        assert configuration.schedule.threads == 1

    def train(self, configuration, seed):
        result = SimpleNamespace(steps=750, rays=configuration.schedule.rays, cpu_s=16.0)
        return Trained(result, {"psnr_union": 20.0, "mask_iou": 0.97}, None)


def test_a_study_measures_each_setting_once_and_goes_on_from_its_table(tmp_path, monkeypatch):
    monkeypatch.setattr(work_precision, "PreparedScene", Prepared)
    monkeypatch.setattr(work_precision, "_write", lambda name, folder: None)
    table = tmp_path / "rows.csv"
    study = Study(["turn"], [], table, tmp_path)
    study.measure([DEFAULT, *KNOBS[1].settings], range(2))
    assert len(study.rows) == 2 * (1 + len(KNOBS[1].settings))
    assert read_rows(table) == study.rows
    monkeypatch.setattr(Prepared, "train", None)
    Study(["turn"], read_rows(table), table, tmp_path).measure([DEFAULT], range(2))


def test_rows_come_back_from_their_table(tmp_path):
    rows = [_row(), _row("rays", "384", 15.25, 19.5), _row(scene="dance, noisy", seed=2)]
    write_rows(rows, tmp_path / "rows.csv")
    assert read_rows(tmp_path / "rows.csv") == rows


def test_the_seeds_of_a_setting_make_one_point_at_their_median():
    rows = [_row(seed=seed, psnr=psnr) for seed, psnr in enumerate((19.0, 21.0, 20.5))]
    (point,) = points_of(rows)
    assert (point.lowest_psnr, point.psnr_union, point.highest_psnr) == (19.0, 20.5, 21.0)
    assert points_of(rows, range(1))[0].psnr_union == 19.0


def test_the_yardstick_gains_nothing_over_itself_and_is_read_over_log_seconds():
    steps = [_row("steps", "188", 10.0, 18.0), _row(), _row("steps", "1500", 40.0, 20.5)]
    between = _row("rays", "384", float(np.sqrt(10.0 * 20.0)), 19.3)
    points = points_of([*steps, between])
    assert [gain_db(point, points) for point in points[:3]] == [0.0, 0.0, 0.0]
    assert gain_db(points[3], points) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("cpu_s", "psnr", "expected"),
    [
        (20.0, 20.2, "better"),
        (25.0, 20.2, None),  # better, at the cost of time
        (15.0, 20.0, "cheaper"),
        (15.0, 19.9, None),  # cheaper, at the cost of error
        (18.0, 20.1, None),  # both, neither clearly
    ],
)
def test_a_default_is_beaten_by_clearly_less_error_or_clearly_less_time_alone(
    cpu_s, psnr, expected
):
    assert verdict(_point(knob="rays", value="384", cpu_s=cpu_s, psnr=psnr), _point()) == expected


def test_a_setting_beats_the_default_only_if_it_does_so_on_every_scene():
    rows = [_row(scene=scene) for scene in ("turn", "dance")]
    good = [_row("rays", "384", 15.0, scene=scene) for scene in ("turn", "dance")]
    mixed = [good[0], _row("rays", "384", 15.0, 19.0, scene="dance")]
    assert beats_default(points_of(good), points_of(rows))
    assert not beats_default(points_of(mixed), points_of(rows))
    assert default_of(points_of(rows), "dance").scene == "dance"


def test_the_document_and_the_chart_show_every_setting_and_the_one_that_beats(tmp_path):
    rows = [_row(seed=seed) for seed in range(3)]
    rows += [_row("rays", "384", 15.0, seed=seed) for seed in range(3)]
    rows += [_row("joint", "rays 384, levels 2", 12.0, seed=seed) for seed in range(3)]
    rows += [_row("levels", "2", 19.0), _row("steps", "375", 12.0, 19.0), _row("budget", "5 s")]
    write_document(rows, "bench --quick", tmp_path / "study.md")
    write_chart(rows, tmp_path / "study.png")
    text = (tmp_path / "study.md").read_text()
    assert sweep_seeds(rows) == range(1)
    sweep = text[text.index("## One knob") : text.index("## Around")]
    assert "| rays | 384 |" in sweep
    assert "| yes |" in sweep
    assert "| levels | 2 | -5%, +0.00 dB" in sweep
    assert "rays 384, levels 2" in text[text.index("## Around") : text.index("## What")]
    assert "| 5 s |" in text
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")
