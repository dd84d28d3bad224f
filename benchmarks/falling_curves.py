"""Does the error at unseen views fall to the end of a run, or does it turn and rise again?

    python -m benchmarks.falling_curves [--label NAME] [--set FIELD=VALUE ...] [--scenes NAME ...]
                                        [--seeds N] [--out FOLDER]

The default preset on small synthetic scenes of every kind, one thread, CPU seconds of the training
clock; PSNR over the person at eight views of other cameras, at every snapshot. Settings make a
further line beside the defaults, under a label of its own. Writes ``falling_curves.parquet``
(every snapshot of every run), ``falling_curves.png`` and ``falling_curves_table.md``, and goes on
from the table in the folder: what it holds already is not run again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import torch

from benchmarks.falling_table import falling_table
from benchmarks.partial_sights import keep_first_frames, narrow_train_camera
from benchmarks.scene_study import PreparedScene
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.metrics.benchmark_tables import Contender, Runs, read_runs, write_runs
from mocoflow_core.metrics.curve import SCHEMA, CurveRow
from mocoflow_core.presets import Configuration, fast
from mocoflow_core.report.benchmark_chart import write_benchmark_chart
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.scene_writer import write_scene

PRESET = "fast"
MEASURED = ("schedule.threads=1", "evaluation.curve_views=8")


def _whole(folder: Path) -> None:
    """The train camera sees all of it."""


class Kind(NamedTuple):
    """A kind of recording: a scene of the catalogue, and what is taken away from it."""

    recording: str
    cut: Callable[[Path], None] = _whole


KINDS = {
    "turn": Kind("turn"),
    "turn_noise3": Kind("turn_noise6,joint_noise_deg=3"),
    "turn_noise6": Kind("turn_noise6"),
    "turn_noise10": Kind("turn_noise6,joint_noise_deg=10"),
    "dance_noise6": Kind("dance_noise6"),
    "turn_other_shape": Kind("turn_other_shape"),
    "turn_loose": Kind("turn_loose"),
    "turn_shadows": Kind("turn_shadows"),
    "spin": Kind("spin"),
    "walk": Kind("walk"),
    "still": Kind("still"),
    # The back is never seen; on a walk the person leaves the picture by half on either side.
    "turn_quarter": Kind("turn", partial(keep_first_frames, count=12)),
    "walk_narrow": Kind("walk", partial(narrow_train_camera, left=48, right=80)),
}


def main() -> None:
    arguments = _arguments()
    table = arguments.out / "falling_curves.parquet"
    runs = read_runs(CurveRow, table) if table.exists() else {}
    configuration = with_settings(fast(), (*MEASURED, *arguments.settings))
    torch.set_num_threads(1)
    for kind in arguments.scenes:
        contender = Contender(kind, PRESET, arguments.label)
        seeds = [s for s in range(arguments.seeds) if s not in runs.get(contender, {})]
        if seeds:
            runs.setdefault(contender, {}).update(_curves(contender, configuration, seeds))
            _write(runs, table)
            print(contender, file=sys.stderr, flush=True)
    write_benchmark_chart(_ordered(runs), table.with_suffix(".png"))
    (arguments.out / "falling_curves_table.md").write_text(falling_table(_ordered(runs)))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--label", default="mocoflow", help="of these settings' line")
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="FIELD=V")
    parser.add_argument("--scenes", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="of all results")
    return parser.parse_args()


def _curves(
    contender: Contender, configuration: Configuration, seeds: Sequence[int]
) -> dict[int, list[CurveRow]]:
    """Every seed's curve of one kind of recording."""
    with TemporaryDirectory() as folder:
        scene = record(contender.scene, Path(folder) / "scene")
        prepared = PreparedScene(scene, configuration)
        return {
            seed: [
                row._replace(scene=contender.scene)
                for row in prepared.curve(configuration, seed, contender.method)
            ]
            for seed in seeds
        }


def record(name: str, folder: Path) -> Scene:
    """A recording of one of the kinds, written to a folder."""
    kind = KINDS[name]
    write_scene(named_scene(kind.recording), folder)
    kind.cut(folder)
    return open_scene(folder)


def _ordered(runs: Runs[CurveRow]) -> Runs[CurveRow]:
    """By kind, as they are listed; settings as they were measured."""
    places = list(KINDS)
    return {c: runs[c] for c in sorted(runs, key=lambda c: places.index(c.scene))}


def _write(runs: Runs[CurveRow], table: Path) -> None:
    table.parent.mkdir(parents=True, exist_ok=True)
    write_runs(runs, SCHEMA, table)


if __name__ == "__main__":
    main()
