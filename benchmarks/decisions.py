"""Each decision of the plan against its opposite: seconds saved, error at unseen views.

    python -m benchmarks.decisions [DECISION ...] > benchmarks/decisions.md

For each decision a scene where it leaves something out and one where it keeps it. Three seeds of
300 steps; CPU seconds of one thread; mean PSNR over the person at eight views of other cameras.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import torch

from benchmarks.altered_recordings import dim_lamp, misplace_bodies, show_again
from benchmarks.scene_study import PreparedScene
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.presets import Configuration, fast
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.scene_writer import write_scene

SEEDS = range(3)
STEPS = ("schedule.coarse_steps=200", "schedule.fine_steps=100", "schedule.threads=1")
TURN = named_scene("turn")
# 48 pixels for a room: the person is 30 pixels tall.
FAR_AWAY = TURN.model_copy(update={"name": "turn_48px", "width": 48, "height": 48})
# Twelve moments, each four times: a recording at a quarter of the rate that its file has.
STUTTER = TURN.model_copy(update={"name": "turn_stutter", "frames": 12})
DIMMED = TURN.model_copy(update={"name": "turn_dimmed"})
# Half a body's width beside its place and a step behind it.
MISPLACED = TURN.model_copy(update={"name": "turn_misplaced"})
ALTERED: dict[str, Callable[[Path], None]] = {
    STUTTER.name: partial(show_again, times=4),
    DIMMED.name: partial(dim_lamp, share=0.3),
    MISPLACED.name: partial(misplace_bodies, offset_m=(0.2, 0.4, 0.0)),
}
# Another decision that would hide this one's effect.
BESIDE = {
    "motion_fields": ("plan.repeated_frames=on",),
    "motion_residual": ("plan.body_repair=off",),
}
SCENES: dict[str, tuple[SyntheticConfig, SyntheticConfig]] = {
    "motion_fields": (named_scene("still"), TURN),
    "motion_residual": (named_scene("turn_loose"), named_scene("turn_noise6")),
    "wide_shell": (TURN, named_scene("turn_loose")),
    "fine_detail": (FAR_AWAY, TURN),
    "repeated_frames": (STUTTER, TURN),
    "body_repair": (TURN, named_scene("turn_noise6")),
    "location_search": (TURN, MISPLACED),
    "appearance_codes": (TURN, DIMMED),
    "fixed_light": (named_scene("still"), TURN),
    "background_extraction": (TURN, TURN),
    "mask_segmentation": (TURN, TURN),
}


class Outcome(NamedTuple):
    """What one way of doing it costs and yields."""

    preparation_s: float
    optimisation_s: float
    psnr: tuple[float, ...]  # of each seed


def main() -> None:
    torch.set_num_threads(1)
    print("| decision | scene | measured: | forced | preparation, s | optimisation, s | PSNR, dB |")
    print("|-|-|-|-|-:|-:|-:|")
    with TemporaryDirectory() as folder:
        for decision in sys.argv[1:] or SCENES:
            for synthetic in dict.fromkeys(SCENES[decision]):
                scene = _write(synthetic, Path(folder) / synthetic.name)
                for force in ("off", "on"):
                    _report(decision, scene, force)


def _report(decision: str, scene: Scene, force: str) -> None:
    beside = BESIDE.get(decision, ())
    auto = PreparedScene(scene, with_settings(fast(), beside)).plan.needs(decision)
    outcome = _outcome(scene, with_settings(fast(), (*STEPS, *beside, f"plan.{decision}={force}")))
    psnr = np.array(outcome.psnr)
    print(
        f"| {decision} | {scene.description.name} | {'needed' if auto else 'left out'} | {force} "
        f"| {outcome.preparation_s:.1f} | {outcome.optimisation_s:.1f} "
        f"| {psnr.mean():.2f} ({psnr.min():.2f} to {psnr.max():.2f}) |",
        flush=True,
    )


def _write(synthetic: SyntheticConfig, folder: Path) -> Scene:
    if not folder.exists():
        write_scene(synthetic, folder)
        ALTERED.get(synthetic.name, _as_recorded)(folder)
    return open_scene(folder)


def _as_recorded(folder: Path) -> None:
    """Nothing is altered."""


def _outcome(scene: Scene, configuration: Configuration) -> Outcome:
    prepared = PreparedScene(scene, configuration)
    runs = [prepared.train(configuration, seed) for seed in SEEDS]
    return Outcome(
        prepared.spent.cpu,
        float(np.mean([run.result.cpu_s for run in runs])),
        tuple(run.scores["psnr_union"] for run in runs),
    )


if __name__ == "__main__":
    main()
