from __future__ import annotations

import re
from dataclasses import replace

import pytest

from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.history import HistoryRow
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import Target, times_to_targets
from mocoflow_core.report.benchmark_page import write_benchmark_page
from mocoflow_core.report.benchmark_results import BenchmarkResults

METHODS = ("mocoflow", "without_local", "posed_mesh")
COMMAND = "mocoflow benchmark --scenes 'turn & <walk>' --out there"


def cell(method: str, seed: int, **changes) -> CellRecord:
    known = {
        "scene": "turn",
        "preset": "fast",
        "method": method,
        "seed": seed,
        "folder": "",
        "state": "finished",
        "train_camera": "cam00",
        "wall_s": 40.0,
        "cpu_s": 45.0,
        "machine": {"model": "a processor", "cores": 2, "threads": 1, "load": 0.5},
    }
    return CellRecord.model_validate(known | changes)


@pytest.fixture(scope="module")
def results() -> BenchmarkResults:
    scores, curves = {}, {}
    for number, method in enumerate(METHODS):
        contender = Contender("turn", "fast", method)
        scores[contender] = {
            seed: [ScoreRow("turn", method, seed, "cam01", 0, "psnr_union", value, "protocol one")]
            for seed, value in ((0, 20.25 - number), (1, 21.75 - number))
        }
        curves[contender] = {
            seed: [
                CurveRow("turn", method, seed, "optimise_scene", 1, t, t, "psnr_union", value)
                for t, value in ((4.0, 15.0), (30.0, 20.0 + seed - number))
            ]
            for seed in (0, 1)
        }
    cells = [cell(method, seed) for method in METHODS[:2] for seed in (0, 1)]
    cells.append(cell("without_local", 2, state="failed", reason="the <moon>", machine={}))
    times = times_to_targets(curves, [Target("psnr_union", 20.0), Target("psnr_union", 33.0)])
    return BenchmarkResults(cells, scores, curves, times)


@pytest.fixture(scope="module")
def page(results, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("page") / "benchmark.html"
    write_benchmark_page(results, COMMAND, path)
    return path.read_text()


def test_nothing_is_fetched_from_beside_the_page(page):
    assert not re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', page)
    assert "<svg" in page


def test_mean_and_range_over_seeds_stand_in_the_table(page):
    assert ">21.00<" in page
    assert "20.25 to 21.75" in page


def test_the_best_of_a_scene_is_marked_once_for_each_metric(page):
    assert re.findall(r'class="number best">([\d.]+)<', page) == ["21.00"]


def test_times_say_how_many_seeds_got_there_and_never_where_none_did(page):
    row = re.sub(r"\s+", " ", page[page.index("<h2>Time to target") :])
    mocoflow = row[row.index(">mocoflow<") : row.index(">without local<")]
    assert "30 s" in mocoflow
    local = row[row.index(">without local<") : row.index(">posed mesh<")]
    assert "never (1/2)" in local
    assert "33 dB" in row


def test_what_failed_stands_above_and_below_and_is_no_markup(page):
    assert "1 run did not finish" in page
    assert "the &lt;moon&gt;" in page
    assert "<moon>" not in page


def test_command_machine_ablation_and_protocol_are_written_down(page):
    assert "turn &amp; &lt;walk&gt;" in page
    assert "model a processor, cores 2, threads 1" in page
    assert "losses.local_share=0.0" in page
    assert "Protocol: protocol one." in page
    assert "3 methods" in page


def test_a_first_night_has_no_history(page):
    assert "Over the nights" not in page
    assert "worse than in earlier nights" not in page


def page_after_nights(results, folder, usual):
    """The page of a benchmark after three nights with the same numbers."""
    past = [
        HistoryRow(f"2026-01-0{night}", "", scene, "fast", method, measure, value)
        for night in (1, 2, 3)
        for (scene, method, measure), value in usual.items()
    ]
    write_benchmark_page(replace(results, past=past), COMMAND, folder / "benchmark.html")
    return (folder / "benchmark.html").read_text()


def test_what_is_worse_than_in_the_nights_before_stands_above_and_beside_their_chart(
    results, tmp_path
):
    psnr = {("turn", "mocoflow", "psnr_union"): 22.0, ("turn", "without_local", "psnr_union"): 20.0}
    page = page_after_nights(results, tmp_path, psnr)
    assert "1 number is worse than in earlier nights" in page
    nights = page[page.index("Over the nights") :]
    assert "turn/fast/mocoflow: PSNR, person" in nights
    assert "21.00 dB, which is 1.00 dB worse than 22.00 dB, the median of the last 3" in nights
    assert "01-03" in nights
    assert "PSNR, person 0.3 dB" in nights


def test_numbers_that_there_are_none_of_any_more_are_told_together(results, tmp_path):
    gone = {("walk", "mocoflow", "ssim"): 0.9, ("walk", "mocoflow", "oks"): 0.8}
    page = page_after_nights(results, tmp_path, gone)
    assert "1 number is worse" in page
    assert "no number any more: OKS (usually 0.800), SSIM (usually 0.900)" in page
    assert page.index("see which") < page.index('id="nights"')  # Though there is no chart.


def test_a_benchmark_of_failures_alone_still_has_its_page(tmp_path):
    failed = [cell("mocoflow", 0, state="failed", reason="no masks", wall_s=None, machine={})]
    path = tmp_path / "benchmark.html"
    write_benchmark_page(BenchmarkResults(failed, {}, {}, []), COMMAND, path)
    assert "no masks" in path.read_text()
