from __future__ import annotations

from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import TimeToTarget
from mocoflow_core.report.omissions import omissions

WHOLE = Contender("turn", "fast", "mocoflow")
PART = Contender("turn", "fast", "without_consensus")


def cell(seed: int = 0, state: str = "finished", **known) -> CellRecord:
    return CellRecord(
        scene="turn",
        preset="fast",
        method="mocoflow",
        seed=seed,
        folder=f"cells/{seed}",
        state=state,
        **known,
    )


def scores(method: str, *values: float) -> dict[int, list[ScoreRow]]:
    return {
        seed: [ScoreRow("turn", method, seed, "cam01", 0, "psnr", value, "white")]
        for seed, value in enumerate(values)
    }


def test_a_benchmark_that_lacks_nothing_omits_nothing():
    runs = {WHOLE: scores("mocoflow", 20.0), PART: scores("without_consensus", 19.0)}
    reached = TimeToTarget(*WHOLE, "psnr", 18.0, 3, 1, None, None)
    assert omissions([cell()], runs, [reached]) == []


def test_cells_that_ended_alike_are_said_once_with_their_reason():
    cells = [cell(seed, "failed", reason="no masks") for seed in (0, 2)]
    cells.append(cell(1, "cancelled", reason="by hand"))
    assert omissions(cells, {}, []) == [
        ("turn/fast/mocoflow, seed 0, 2", "failed: no masks"),
        ("turn/fast/mocoflow, seed 1", "cancelled: by hand"),
    ]


def test_refused_steps_of_a_finished_cell_are_said():
    [found] = omissions([cell(guard_events=("NaN in the loss at step 7",))], {}, [])
    assert "step 7" in found.why


def test_an_ablation_with_the_very_same_scores_compares_nothing():
    same = {WHOLE: scores("mocoflow", 20.0, float("nan"))}
    same[PART] = scores("without_consensus", 20.0, float("nan"))
    [found] = omissions([], same, [])
    assert found.what == "turn/fast/without_consensus"
    assert "consensus" in found.why


def test_the_last_digit_of_one_seed_is_a_difference():
    runs = {WHOLE: scores("mocoflow", 20.0, 21.0)}
    runs[PART] = scores("without_consensus", 20.0, 21.0 + 4e-15)
    assert omissions([], runs, []) == []


def test_a_target_that_nobody_reached_is_said_and_one_that_somebody_did_is_not():
    times = [
        TimeToTarget(*WHOLE, "psnr", 20.0, 3, 1, None, None),
        TimeToTarget(*PART, "psnr", 20.0, 3, 0, None, None),
        TimeToTarget(*WHOLE, "psnr", 30.0, 3, 0, None, None),
        TimeToTarget(*PART, "psnr", 30.0, 3, 0, None, None),
    ]
    [found] = omissions([], {}, times)
    assert found.why == "no seed of any method reached 30 dB"
