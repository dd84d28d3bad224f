"""The folder that a run leaves to its user: claimed at the start, finished at the end."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError

from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input

RUN = "run.json"


class StageRecord(BaseModel):
    """What one stage of the run cost, and whether it was found instead of computed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    key: str
    wall_s: float
    cpu_s: float
    cached: bool


class RunRecord(BaseModel):
    """The content of ``run.json``.

    ``request`` stands for scene, settings and seed; ``overhead_s`` is what the run took besides
    its stages.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    request: str
    finished: bool = False
    scene: str
    scene_path: str
    preset: str
    seed: int
    configuration: dict[str, JsonValue]
    store: str
    license: str = ""
    attribution: str = ""
    remarks: tuple[str, ...] = ()  # of the scene, for whoever reads the scores
    overhead_s: float = 0.0
    machine: dict[str, JsonValue] = {}
    stages: tuple[StageRecord, ...] = ()
    train_camera: str = ""
    capture: dict[str, JsonValue] = {}
    cameras: dict[str, JsonValue] = {}
    scores: dict[str, JsonValue] = {}
    warnings: tuple[str, ...] = ()
    guard_events: tuple[str, ...] = ()
    outputs: dict[str, int] = {}

    def stage(self, name: str) -> StageRecord:
        return next(stage for stage in self.stages if stage.name == name)


def read_run(folder: Path) -> RunRecord:
    """The record of a finished run. Raises InputError where there is none."""
    record = _record(folder)
    if record is None or not record.finished:
        raise InputError(
            "The folder of a finished run",
            f"{folder} {'with an unfinished one' if record else f'without a {RUN}'}",
            "Run `mocoflow reconstruct SCENE --out` with this folder first.",
        )
    return record


@dataclass(frozen=True)
class RunFolder:
    """A folder that belongs to one request."""

    path: Path
    begun: RunRecord

    @classmethod
    def claim(cls, path: Path, begun: RunRecord) -> RunFolder:
        """Take a new or empty folder, or one of the same request; refuse anything else.

        A run that left nothing but its record, because its input was bad, gives its folder up.
        """
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            held = _record(path)
            if held is not None and held.request == begun.request:
                return cls(path, begun)
            if held is None or held.finished or not _holds_nothing_else(path):
                raise InputError(
                    "--out must be new, empty, or of the same scene and settings",
                    f"{path} with {'another run' if held else 'something else in it'}",
                    "Choose another folder.",
                )
        with full_disk_is_bad_input(f"The folder {path}"):
            path.mkdir(parents=True, exist_ok=True)
            _write(path, begun)
        return cls(path, begun)

    def is_finished(self) -> bool:
        """Whether the run was finished and all that it left is still there."""
        record = _record(self.path)
        if record is None or not record.finished:
            return False
        files = {self.path / name: size for name, size in record.outputs.items()}
        return all(file.is_file() and file.stat().st_size == size for file, size in files.items())

    def take(self, source: Path, name: str) -> None:
        """Copy a file or a folder out of an artifact; it appears complete or not at all."""
        target, beside = self.path / name, self.path / f".{name}.new"
        with full_disk_is_bad_input(f"The folder {self.path}"):
            _remove(beside)
            (shutil.copytree if source.is_dir() else shutil.copyfile)(source, beside)
            _remove(target)
            beside.rename(target)

    def finish(self, values: dict[str, Any]) -> RunRecord:
        """Write ``run.json``, the last file: with it the run is finished."""
        files = (p for p in sorted(self.path.rglob("*")) if p.is_file() and p.name != RUN)
        outputs = {file.relative_to(self.path).as_posix(): file.stat().st_size for file in files}
        record = self.begun.model_copy(update={**values, "outputs": outputs, "finished": True})
        with full_disk_is_bad_input(f"The folder {self.path}"):
            _write(self.path, record)
        return record


def _record(folder: Path) -> RunRecord | None:
    try:
        return RunRecord.model_validate_json((folder / RUN).read_bytes())
    except (OSError, ValidationError):
        return None


def _holds_nothing_else(folder: Path) -> bool:
    return {file.name for file in folder.iterdir()} <= {RUN, f".{RUN}.new"}


def _write(folder: Path, record: RunRecord) -> None:
    beside = folder / f".{RUN}.new"
    beside.write_text(json.dumps(record.model_dump(mode="json"), indent=1) + "\n")
    beside.replace(folder / RUN)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
