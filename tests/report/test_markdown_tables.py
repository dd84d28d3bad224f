from __future__ import annotations

import pytest

from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.methods.experiments import EXPERIMENTS
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.misalignment import MisalignmentRow
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.benchmark_results import BenchmarkResults
from mocoflow_core.report.markdown_tables import write_markdown_tables

VALUES = {
    "mocoflow": {"psnr_union": (20.25, 21.75), "surface_mm": (9.0, 9.0)},
    "without_box": {"psnr_union": (19.0, 19.0), "surface_mm": (7.0, 7.0)},
}
MISPLACED = [
    MisalignmentRow("turn", "shifted", 10.0, "px", 2.5, "psnr", 17.125, 3, "four directions"),
    MisalignmentRow("turn", "turned", 5.0, "degrees", None, "psnr", 21.5, 3, "four directions"),
]


def scores() -> dict:
    return {
        Contender("turn", "paper", method): {
            seed: [
                ScoreRow("turn", method, seed, "cam01", 0, metric, values[seed], "white")
                for metric, values in metrics.items()
            ]
            for seed in (0, 1)
        }
        for method, metrics in VALUES.items()
    }


@pytest.fixture(scope="module")
def lines(tmp_path_factory) -> list[str]:
    known = {"scene": "turn", "preset": "paper", "folder": "", "train_camera": "cam00", "seed": 0}
    cells = [CellRecord(**known, method=method, state="finished") for method in VALUES]
    cells.append(CellRecord(**known, method="without_light", state="refused", reason="no | light"))
    results = BenchmarkResults(
        cells, scores(), {}, [], misplaced=MISPLACED, experiment=EXPERIMENTS["removal"]
    )
    path = tmp_path_factory.mktemp("tables") / "table.md"
    write_markdown_tables(results, "mocoflow benchmark --out there", path)
    return path.read_text().splitlines()


def test_a_row_is_a_method_with_mean_range_and_the_best_in_bold(lines):
    start = lines.index("## turn") + 2
    assert lines[start : start + 4] == [
        "| method | seeds | PSNR, person, dB | surface, mm |",
        "| - | -: | -: | -: |",
        "| mocoflow | 2 | **21.00** (20.25 to 21.75) | 9.0 |",
        "| without box | 2 | 19.00 | **7.0** |",
    ]


def test_the_experiment_its_command_and_its_methods_stand_beside_it(lines):
    assert lines[0] == f"# {EXPERIMENTS['removal'].title}"
    assert "`mocoflow benchmark --out there`" in lines
    assert any("plan.adaptive_box" in line for line in lines if line.startswith("- without box"))


def test_misplaced_views_have_a_table_of_their_own(lines):
    start = lines.index("## turn, misplaced views") + 2
    assert lines[start : start + 4] == [
        "|  | PSNR, crop, dB |",
        "| - | -: |",
        "| shifted by 10 px (2.5) | 17.12 |",
        "| turned by 5 degrees | 21.50 |",
    ]
    assert "Protocol: four directions." in lines


def test_what_was_refused_is_said_with_its_reason(lines):
    assert "- turn/paper/without_light, seed 0: refused: no \\| light" in lines


def test_photographs_stand_in_the_table_and_compete_with_nobody(tmp_path):
    values = {"mocoflow": 0.5, "posed_mesh": 0.25, "photograph": 0.75}
    rows = {
        Contender("turn", "fast", method): {
            0: [ScoreRow("turn", method, 0, "cam01", 0, "plausibility", value, "white")]
        }
        for method, value in values.items()
    }
    known = {"scene": "turn", "preset": "fast", "folder": "", "train_camera": "cam00", "seed": 0}
    cells = [CellRecord(**known, method="mocoflow", state="finished")]
    write_markdown_tables(BenchmarkResults(cells, rows, {}, []), "", tmp_path / "table.md")
    text = (tmp_path / "table.md").read_text()
    assert "| mocoflow | 1 | **0.50** |" in text
    assert "| photograph | 1 | 0.75 |" in text
    assert "The photograph's row has the photographs in place of renders" in text
