"""Each decision of the plan against its opposite: seconds saved, error at unseen views.

    python benchmarks/decisions.py [DECISION ...] > benchmarks/decisions.md

For each decision a scene where it leaves something out and one where it keeps it. Three seeds of
300 steps; CPU seconds of one thread; mean PSNR over the person at eight views of other cameras.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import torch

from mocoflow_core.body.ingest import ingest_meshes
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import ClipNeeds, extract_clip, extract_evaluation
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.methods.rendered_views import ScoredView, TrainedRenderer, scored_views
from mocoflow_core.methods.scored_views import Subject, few_views, score_views
from mocoflow_core.planning.inspection import inspect_scene
from mocoflow_core.planning.plan import ScenePlan, plan_scene
from mocoflow_core.planning.preparation import decide_frames, decide_preparation
from mocoflow_core.planning.repair import repair_where_needed
from mocoflow_core.presets import Configuration, fast
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.scene_writer import write_scene
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.fit_motion import MotionStart, fit_motion
from mocoflow_core.training.optimise_scene import Learned, optimise_scene
from mocoflow_core.training.pretrain_density import pretrain_density

SEEDS = range(3)
STEPS = ("schedule.coarse_steps=200", "schedule.fine_steps=100", "schedule.threads=1")
TURN = named_scene("turn")
# 48 pixels for a room: the person is 30 pixels tall.
FAR_AWAY = TURN.model_copy(update={"name": "turn_48px", "width": 48, "height": 48})
# Twelve moments, each four times: a recording at a quarter of the rate that its file has.
STUTTER = TURN.model_copy(update={"name": "turn_stutter", "frames": 12})
SHOWN = {STUTTER.name: 4}
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
    "background_extraction": (TURN, TURN),
    "mask_segmentation": (TURN, TURN),
}


class Outcome(NamedTuple):
    """What one way of doing it costs and yields."""

    preparation_s: float
    optimisation_s: float
    psnr: tuple[float, ...]  # of each seed


class Prepared(NamedTuple):
    """What the optimisation starts from."""

    clip: Clip
    plan: ScenePlan
    density: CanonicalDensity
    motion: MotionStart


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
    auto = _prepared(scene, with_settings(fast(), beside)).plan.needs(decision)
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
        _show_again(folder, SHOWN.get(synthetic.name, 1))
    return open_scene(folder)


def _show_again(folder: Path, times: int) -> None:
    """Each frame of the train camera ``times`` times in a row; the others keep one of them."""
    description = json.loads((folder / "scene.json").read_text())
    for files in (*folder.glob("frames/*"), *folder.glob("masks/*")):
        copies = times if files.name == description["train_camera"] else 1
        for file in sorted(files.iterdir(), reverse=True):
            number, suffix = times * int(file.stem), file.suffix
            picture = file.read_bytes()
            file.unlink()
            for copy in range(copies):
                (files / f"{number + copy:06d}{suffix}").write_bytes(picture)
    meshes = MeshSequence.load(folder / "meshes.npz")
    again = np.arange(times * len(meshes.vertices), dtype=np.int32)
    meshes = replace(meshes, frame_indices=again, vertices=meshes.vertices[again // times])
    meshes.save(folder / "meshes.npz")
    description.pop("truth", None)
    (folder / "scene.json").write_text(json.dumps(description))


def _outcome(scene: Scene, configuration: Configuration) -> Outcome:
    start = time.process_time()
    clip, plan, density, motion = _prepared(scene, configuration)
    preparation_s = time.process_time() - start
    canonical = configuration.canonical
    canonical = canonical.model_copy(update={"finest_m": plan.no_finer(canonical.finest_m)})
    sampling = configuration.sampling
    sampling = sampling.model_copy(update={"step_m": plan.no_finer(sampling.step_m)})
    shape = SceneShape(
        canonical=canonical,
        motion=configuration.motion,
        times=tuple(clip.times[~clip.held_out].tolist()),
        shell_width_m=plan.shell_width_m,
        inner_depth_m=sampling.inner_depth_m,
        step_m=sampling.step_m,
        residual=plan.needs("motion_residual"),
        light=plan.light,
    )
    learned = Learned(
        plan.needs("motion_residual"),
        plan.needs("motion_consensus"),
        plan.needs("appearance_codes"),
    )
    views = _views(scene, clip, configuration)
    seconds, psnr, opened = [], [], None
    for seed in SEEDS:
        with TemporaryDirectory() as folder:
            result = optimise_scene(
                clip,
                density,
                motion,
                shape,
                learned,
                configuration.losses,
                sampling,
                configuration.schedule,
                seed,
                Seconds(),
                Path(folder),
                lambda share, text: None,
            )
            trained = TrainedScene.open(Path(folder))
        if opened is not None:
            trained.share_bodies(opened)
        opened = trained
        seconds.append(result.cpu_s)
        psnr.append(_psnr(TrainedRenderer(trained, clip), views, configuration))
    return Outcome(preparation_s, float(np.mean(seconds)), tuple(psnr))


def _prepared(scene: Scene, configuration: Configuration) -> Prepared:
    choose = configuration.plan
    given = ingest_meshes(scene)
    preparation = decide_preparation(inspect_scene(scene, given), choose)
    needed = {decision.name: decision.needed for decision in preparation}
    needs = ClipNeeds(
        background=needed["background_extraction"],
        masks=needed["mask_segmentation"],
        repeated_frames=choose.repeated_frames == "on",
    )
    clip = extract_clip(scene, configuration.capture, needs)
    meshes, repair = repair_where_needed(
        clip, given.meshes, configuration.repair, choose.body_repair, lambda share, text: None
    )
    frames = decide_frames(0, len(clip.frames), choose)
    plan = plan_scene(clip, meshes, (*preparation, frames, repair), choose)
    density = pretrain_density(meshes, plan.canonical_frame, configuration.density)
    motion = fit_motion(
        clip,
        meshes,
        density,
        plan.shell_width_m,
        plan.needs("motion_fields"),
        configuration.motion,
    )
    return Prepared(clip, plan, density, motion)


def _views(scene: Scene, clip: Clip, configuration: Configuration) -> list[ScoredView]:
    others = extract_evaluation(scene, clip.frame_indices, configuration.capture)
    return few_views(scored_views(clip, others, configuration.evaluation), configuration.evaluation)


def _psnr(
    renderer: TrainedRenderer, views: list[ScoredView], configuration: Configuration
) -> float:
    rows = score_views(Subject("", 0), "", views, renderer, configuration.evaluation)
    return float(np.mean([row.value for row in rows if row.metric == "psnr_union"]))


if __name__ == "__main__":
    main()
