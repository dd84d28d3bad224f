"""What a benchmark leaves: one folder for each cell, and the record of all of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError

from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.metrics.benchmark_tables import Cell
from mocoflow_core.metrics.curve import training_spans
from mocoflow_core.planning.plan import ScenePlan

RECORD = "benchmark.json"


class CellRecord(BaseModel):
    """How one run of the benchmark ended; seconds are those of its training clock."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene: str
    preset: str
    method: str
    seed: int
    folder: str  # in the benchmark's folder
    state: Literal["finished", "failed", "cancelled", "refused"]
    reason: str = ""  # why it did not finish, or was not begun: its settings make no sense
    train_camera: str = ""
    wall_s: float | None = None
    cpu_s: float | None = None
    from_store: bool = False  # trained before, by another command
    machine: dict[str, JsonValue] = {}
    left_out: tuple[str, ...] = ()  # by the plan
    warnings: tuple[str, ...] = ()
    guard_events: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.scene}/{self.preset}/{self.method}/{self.seed}"

    def finished_as(self, run: RunRecord, folder: Path) -> CellRecord:
        """The same cell with what its finished run says in ``run.json`` and ``plan.json``."""
        stages = [stage.model_dump() for stage in run.stages]
        plan = ScenePlan.model_validate_json((folder / "plan.json").read_text())
        return self.model_copy(
            update={
                "state": "finished",
                "train_camera": run.train_camera,
                "wall_s": training_spans(stages)[-1].end_s,
                "cpu_s": training_spans(stages, "cpu_s")[-1].end_s,
                "from_store": run.stage("optimise_scene").cached,
                "machine": run.machine,
                "left_out": tuple(d.name for d in plan.decisions if not d.needed),
                "warnings": run.warnings,
                "guard_events": run.guard_events,
            }
        )


class BenchmarkRecord(BaseModel):
    """The content of ``benchmark.json``. Cells of one folder share settings and budget."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    experiment: str | None = None
    settings: tuple[str, ...]
    budget_s: float | None
    command: str
    question: str = ""  # the command without its places: nights that ask the same are compared
    finished: bool = False
    finished_at: str = ""  # UTC, ISO 8601; empty where no cell has finished
    cells: tuple[CellRecord, ...] = ()
    summary: tuple[dict[str, JsonValue], ...] = ()
    omissions: tuple[dict[str, JsonValue], ...] = ()
    regressions: tuple[dict[str, JsonValue], ...] = ()

    @property
    def has_finished_cell(self) -> bool:
        return any(cell.state == "finished" for cell in self.cells)


@dataclass(frozen=True)
class BenchmarkFolder:
    """A folder that belongs to benchmarks with the same settings."""

    path: Path
    begun: BenchmarkRecord

    @classmethod
    def claim(cls, path: Path, begun: BenchmarkRecord) -> BenchmarkFolder:
        """Take a new or empty folder, or one that more scenes, methods and seeds may go into."""
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            held = read_benchmark(path)
            if held is None or (held.settings, held.budget_s) != (begun.settings, begun.budget_s):
                raise InputError(
                    "--out must be new, empty, or of a benchmark with the same --set and --budget",
                    f"{path} with {'another benchmark' if held else 'something else in it'}",
                    "Choose another folder.",
                )
            if held.question == begun.question:
                begun = begun.model_copy(update={"finished_at": held.finished_at})
        with full_disk_is_bad_input(f"The folder {path}"):
            path.mkdir(parents=True, exist_ok=True)
            return cls(path, begun)._written(begun)

    def take(self, source: Path, name: str) -> None:
        """Copy a file out of an artifact; it appears complete or not at all."""
        beside = self.path / f".{name}.new"
        with full_disk_is_bad_input(f"The folder {self.path}"):
            beside.write_bytes(source.read_bytes())
            beside.replace(self.path / name)

    def finish(self, values: Mapping[str, object]) -> BenchmarkRecord:
        """Write ``benchmark.json``, the last file.

        The moment is that of the first time that there was anything to compare.
        """
        record = self.begun.model_copy(update={**values, "finished": True})
        if record.has_finished_cell and not record.finished_at:
            moment = datetime.now(UTC).isoformat(timespec="seconds")
            record = record.model_copy(update={"finished_at": moment})
        with full_disk_is_bad_input(f"The folder {self.path}"):
            self._written(record)
        return record

    def _written(self, record: BenchmarkRecord) -> BenchmarkFolder:
        beside = self.path / f".{RECORD}.new"
        beside.write_text(json.dumps(record.model_dump(mode="json"), indent=1) + "\n")
        beside.replace(self.path / RECORD)
        return self


def finished_cells(records: Iterable[Mapping[str, JsonValue]], folder: Path) -> list[Cell]:
    """Those that finished, with the folders of their tables in the benchmark's ``folder``."""
    cells = [CellRecord.model_validate(record) for record in records]
    return [
        Cell(cell.scene, cell.preset, cell.method, cell.seed, folder / cell.folder)
        for cell in cells
        if cell.state == "finished"
    ]


def read_benchmark(folder: Path) -> BenchmarkRecord | None:
    """The record in a benchmark's folder; None where there is none that can be read."""
    try:
        return BenchmarkRecord.model_validate_json((folder / RECORD).read_bytes())
    except (OSError, ValidationError):
        return None
