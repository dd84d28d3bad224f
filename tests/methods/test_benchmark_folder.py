from __future__ import annotations

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.methods.benchmark_folder import (
    BenchmarkFolder,
    BenchmarkRecord,
    CellRecord,
    finished_cells,
)


def begun(*settings: str, budget_s: float | None = None, command: str = "") -> BenchmarkRecord:
    return BenchmarkRecord(settings=settings, budget_s=budget_s, command=command)


def test_more_scenes_may_go_into_the_folder_of_the_same_settings(tmp_path):
    BenchmarkFolder.claim(tmp_path / "out", begun("a=1", command="one scene"))
    BenchmarkFolder.claim(tmp_path / "out", begun("a=1", command="two scenes"))


@pytest.mark.parametrize("other", [begun("a=2"), begun("a=1", budget_s=5.0)])
def test_cells_of_other_settings_do_not_go_into_it(other, tmp_path):
    BenchmarkFolder.claim(tmp_path / "out", begun("a=1"))
    with pytest.raises(InputError, match="another benchmark"):
        BenchmarkFolder.claim(tmp_path / "out", other)


def test_a_folder_that_holds_something_else_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="something else"):
        BenchmarkFolder.claim(tmp_path, begun())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_only_finished_cells_have_tables(tmp_path):
    records = [
        CellRecord(scene="s", preset="p", method="m", seed=seed, folder=f"c/{seed}", state=state)
        for seed, state in enumerate(("finished", "failed", "cancelled"))
    ]
    [cell] = finished_cells([record.model_dump() for record in records], tmp_path)
    assert cell == ("s", "p", "m", 0, tmp_path / "c/0")
