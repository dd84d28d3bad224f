"""Work against precision: what each knob of the default preset costs, and the error it yields.

    python -m benchmarks.work_precision [--whole] [--keep] [--out FOLDER]

Every knob alone around the defaults, the best of them together, and the defaults under budgets; on
small synthetic scenes, one thread, CPU seconds of the training clock, PSNR over the person and
mask overlap at eight views of other cameras. Writes ``work_precision.csv`` (every run),
``work_precision.png`` and ``work_precision.md``. A study that was stopped, or that is to be drawn
again, goes on from its table with ``--keep``.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import torch

from benchmarks.knobs import BUDGETS_S, DEFAULT, KNOBS, Setting, budget, together
from benchmarks.precision_chart import write_chart
from benchmarks.precision_document import write_document
from benchmarks.precision_front import mean_gain_db
from benchmarks.precision_rows import Row, points_of, read_rows, write_rows
from benchmarks.scene_study import PreparedScene
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.presets import Configuration
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.scene_writer import write_scene

COMMAND = "python -m benchmarks.work_precision"
ONE_THREAD = ("schedule.threads=1",)


class Extent(NamedTuple):
    """How much of the study is measured."""

    scenes: tuple[str, ...]
    sweep_seeds: range
    joint_seeds: range
    joined: int  # the best two settings of different knobs together, and so on to so many


USUAL = Extent(
    ("turn,frames=24", "dance_noise6,frames=24", "turn_loose,frames=24"), range(1), range(2), 3
)
WHOLE = Extent((*USUAL.scenes, "spin,frames=24"), range(2), range(3), 4)


def main() -> None:
    arguments = _arguments()
    extent = WHOLE if arguments.whole else USUAL
    table = arguments.out / "work_precision.csv"
    rows = read_rows(table) if arguments.keep and table.exists() else []
    torch.set_num_threads(1)
    with TemporaryDirectory() as folder:
        study = Study(extent.scenes, rows, table, Path(folder))
        sweep = [s for knob in KNOBS for s in knob.chosen(arguments.whole)]
        study.measure([DEFAULT, *sweep], extent.sweep_seeds)
        best = _best_of_each_knob(sweep, study.rows, extent)
        joined = [together(tuple(best[:count])) for count in range(2, len(best) + 1)]
        study.measure([DEFAULT, *joined], extent.joint_seeds)
        study.measure(map(budget, BUDGETS_S), extent.sweep_seeds)
    write_chart(study.rows, arguments.out / "work_precision.png")
    command = shlex.join([*COMMAND.split(), *sys.argv[1:]])
    write_document(study.rows, command, arguments.out / "work_precision.md")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--whole", action="store_true", help="more values, scenes and seeds")
    parser.add_argument("--keep", action="store_true", help="go on from the table in the folder")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="of all results")
    return parser.parse_args()


def _best_of_each_knob(
    sweep: Sequence[Setting], rows: Sequence[Row], extent: Extent
) -> list[Setting]:
    """The settings with the largest gains over the yardstick, one for each knob."""
    points = points_of(rows, extent.sweep_seeds)
    gains = {s: mean_gain_db(s.knob, s.value, points) for s in sweep if s.knob != "steps"}
    ranked = sorted((s for s in gains if gains[s] > 0), key=lambda s: -gains[s])
    best = {s.knob: s for s in reversed(ranked)}
    return sorted(best.values(), key=ranked.index)[: extent.joined]


class Study:
    """The scenes and what was measured on them so far; the table is on disk after every run."""

    def __init__(self, scenes: Sequence[str], rows: list[Row], table: Path, folder: Path) -> None:
        self.rows = rows
        self._table = table
        self._scenes = {name: _write(name, folder / name) for name in scenes}
        self._prepared: dict[tuple[str, str], PreparedScene] = {}

    def measure(self, settings: Iterable[Setting], seeds: range) -> None:
        """Run what the table does not hold yet; seeds outermost, as the machine's speed drifts."""
        settings = list(settings)
        for seed in seeds:
            for setting in settings:
                for scene in self._scenes:
                    if not self._holds(scene, setting, seed):
                        self._run(scene, setting, seed)

    def _holds(self, scene: str, setting: Setting, seed: int) -> bool:
        looked_for = (scene, setting.knob, setting.value, seed)
        return any((r.scene, r.knob, r.value, r.seed) == looked_for for r in self.rows)

    def _run(self, scene: str, setting: Setting, seed: int) -> None:
        configuration = with_settings(setting.configuration, ONE_THREAD)
        prepared = self._prepare(scene, configuration)
        trained = prepared.train(configuration, seed)
        result, scores = trained.result, trained.scores
        row = Row(
            scene,
            setting.knob,
            setting.value,
            " ".join(setting.changes),
            seed,
            result.steps,
            result.rays,
            prepared.spent.cpu,
            result.cpu_s,
            scores["psnr_union"],
            scores["mask_iou"],
        )
        self.rows.append(row)
        write_rows(self.rows, self._table)
        print(*row[:3], f"seed {seed}", *(f"{v:.2f}" for v in row[7:]), file=sys.stderr, flush=True)

    def _prepare(self, scene: str, configuration: Configuration) -> PreparedScene:
        """Once for all settings that leave the preparation as it is."""
        parts = {"capture", "repair", "plan", "density", "motion"}
        key = (scene, configuration.model_dump_json(include=parts))
        if key not in self._prepared:
            self._prepared[key] = PreparedScene(self._scenes[scene], configuration)
        return self._prepared[key]


def _write(name: str, folder: Path) -> Scene:
    write_scene(named_scene(name), folder)
    return open_scene(folder)


if __name__ == "__main__":
    main()
