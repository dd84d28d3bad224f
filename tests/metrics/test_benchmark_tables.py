from __future__ import annotations

from pathlib import Path

import pytest
from pyarrow import parquet

from mocoflow_core.metrics import curve, table
from mocoflow_core.metrics.benchmark_tables import (
    Cell,
    Contender,
    gather,
    read_runs,
    write_runs,
)
from mocoflow_core.metrics.table import ScoreRow, read_scores, write_scores

METHODS = ("mocoflow", "without_local", "posed_mesh")


def score(method: str, seed: int, value: float) -> ScoreRow:
    return ScoreRow("name in scene.json", method, seed, "cam01", 0, "psnr", value, "white")


@pytest.fixture
def cells(tmp_path: Path) -> list[Cell]:
    """Two methods and two seeds; the posed mesh is scored in each, differently to tell whence."""
    found = []
    for number, (method, seed) in enumerate((m, s) for m in METHODS[:2] for s in (0, 1)):
        folder = tmp_path / method / str(seed)
        folder.mkdir(parents=True)
        rows = [score("mocoflow", seed, 20.0 + number), score("posed_mesh", seed, 10.0 + number)]
        write_scores(rows, folder / "scores.parquet")
        found.append(Cell("turn", "fast", method, seed, folder))
    return found


def gathered(cells: list[Cell], methods: tuple[str, ...] = METHODS):
    return gather(cells, methods, read_scores, "scores.parquet")


def values(runs, method: str) -> dict[int, list[float]]:
    seeds = runs[Contender("turn", "fast", method)]
    return {seed: [row.value for row in rows] for seed, rows in seeds.items()}


def test_an_ablation_carries_its_own_name_although_its_run_does_not_know_it(cells):
    runs = gathered(cells)
    assert values(runs, "mocoflow") == {0: [20.0], 1: [21.0]}
    assert values(runs, "without_local") == {0: [22.0], 1: [23.0]}
    for contender, seeds in runs.items():
        rows = [row for rows in seeds.values() for row in rows]
        assert {(row.scene, row.method) for row in rows} == {("turn", contender.method)}


def test_a_method_within_other_runs_is_taken_once_for_each_seed(cells):
    assert values(gathered(cells), "posed_mesh") == {0: [10.0], 1: [11.0]}
    assert values(gathered(cells[2:]), "posed_mesh") == {0: [12.0], 1: [13.0]}


def test_only_the_methods_asked_for_are_there_in_their_order(cells):
    assert [c.method for c in gathered(cells, ("posed_mesh", "mocoflow"))] == [
        "posed_mesh",
        "mocoflow",
    ]


def test_presets_stay_apart_in_the_table(cells, tmp_path):
    toy = [cell._replace(preset="toy") for cell in cells]
    runs = gathered([*cells, *toy])
    write_runs(runs, table.SCHEMA, tmp_path / "scores.parquet")
    assert read_runs(ScoreRow, tmp_path / "scores.parquet") == runs
    assert {contender.preset for contender in runs} == {"fast", "toy"}


def test_what_reads_the_table_of_a_run_reads_a_benchmarks(cells, tmp_path):
    runs = gathered(cells)
    write_runs(runs, table.SCHEMA, tmp_path / "scores.parquet")
    every = [row for seeds in runs.values() for rows in seeds.values() for row in rows]
    assert read_scores(tmp_path / "scores.parquet") == every


def test_the_columns_are_those_of_a_run_and_the_preset(tmp_path):
    for schema in (table.SCHEMA, curve.SCHEMA):
        write_runs({}, schema, tmp_path / "empty.parquet")
        assert parquet.read_schema(tmp_path / "empty.parquet").names == [*schema.names, "preset"]
