"""States that are kept while the optimisation goes on: the points of the error curve."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from safetensors.torch import save_file

from mocoflow_core.fields.scene_field import SceneField
from mocoflow_core.training.clock import Seconds

_FOLDER, _INDEX = "snapshots", "snapshots.json"


@dataclass(frozen=True)
class Snapshot:
    """One kept state: when it was taken, and how well it shows held-out train pixels."""

    step: int
    wall_s: float  # of the optimisation alone
    cpu_s: float
    train_psnr: float | None = None  # dB; None where nothing is held out


def read_snapshots(scene: Path) -> list[Snapshot]:
    """The snapshots of a scene's folder, in the order of its clock."""
    index = scene / _FOLDER / _INDEX
    return [Snapshot(**entry) for entry in json.loads(index.read_text())] if index.exists() else []


def snapshot_weights(scene: Path, snapshot: Snapshot) -> Path:
    """The file with the weights of a snapshot."""
    return scene / _FOLDER / f"{snapshot.step:06d}.safetensors"


def forget_snapshots(scene: Path, after: int) -> None:
    """Drop those later than a step: a try that was killed took them, and its clock is lost."""
    known = read_snapshots(scene)
    lost = [snapshot for snapshot in known if snapshot.step > after]
    if lost:
        _write_index(scene, [snapshot for snapshot in known if snapshot.step <= after])
        for snapshot in lost:
            snapshot_weights(scene, snapshot).unlink(missing_ok=True)


def keep_snapshot(
    scene: Path, field: SceneField, step: int, elapsed: Seconds, train_psnr: float | None
) -> list[Snapshot]:
    """Save the present state and give all snapshots up to it; one of the same step is replaced."""
    (scene / _FOLDER).mkdir(exist_ok=True)
    taken = Snapshot(step, elapsed.wall, elapsed.cpu, train_psnr)
    kept = [earlier for earlier in read_snapshots(scene) if earlier.step < step] + [taken]
    save_file(field.state_dict(), snapshot_weights(scene, taken))
    _write_index(scene, kept)
    return kept


def _write_index(scene: Path, snapshots: list[Snapshot]) -> None:
    beside = scene / _FOLDER / f"{_INDEX}.new"
    beside.write_text(json.dumps([asdict(snapshot) for snapshot in snapshots]))
    beside.replace(scene / _FOLDER / _INDEX)
