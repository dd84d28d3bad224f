"""Wrong estimates before and after: joints that err by degrees, bodies that err in place.

    python -m benchmarks.estimate_repair [--motions NAME ...] > benchmarks/estimate_repair.md

Default preset with 300 steps, one seed, one thread. Keypoints and the consensus of the motion over
the clip in mm, the body's outline in the masks of the train camera, PSNR over the person and mask
overlap at eight views of other cameras. ``given`` is the estimate, where the location search has
put it if the plan asked for one; ``repaired`` the meshes before, ``learned`` the motion after the
optimisation. The truth serves these tables alone.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import torch

from benchmarks.scene_study import PreparedScene
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.methods.truth_errors import TruthConfig, motion_rows
from mocoflow_core.presets import fast
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.scene_writer import write_scene

SETTINGS = ("schedule.coarse_steps=200", "schedule.fine_steps=100", "schedule.threads=1")
MOTIONS = ("turn", "dance")
HEADER = (
    "| scene | joints, degrees | place, cm | place searched | repair, s "
    "| keypoints, mm: given -> learned | across the sight | along it "
    "| outline IoU: given -> repaired | consensus, mm: given -> learned "
    "| unseen views: PSNR, dB | IoU |"
)


class Noise(NamedTuple):
    """What the estimate is wrong by, root mean square."""

    joints_deg: float
    place_cm: float

    def scene(self, motion: str) -> str:
        wrong = f"joint_noise_deg={self.joints_deg:g},place_noise_m={self.place_cm / 100:g}"
        return f"{motion}_noise6,{wrong}"


SIZES = (3.0, 6.0, 10.0)
NOISES = (
    Noise(0, 0),
    *(Noise(size, 0) for size in SIZES),
    *(Noise(0, size) for size in SIZES),
    *(Noise(size, size) for size in SIZES),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--motions", nargs="+", default=MOTIONS)
    torch.set_num_threads(1)
    print(HEADER)
    print("|-" * 3 + "|-" + "|-:" * 8 + "|")
    for motion in parser.parse_args().motions:
        for noise in NOISES:
            print(_row(motion, noise), flush=True)


def _row(motion: str, noise: Noise) -> str:
    configuration = with_settings(fast(), SETTINGS)
    with TemporaryDirectory() as name:
        write_scene(named_scene(noise.scene(motion)), Path(name))
        scene = open_scene(Path(name))
        prepared = PreparedScene(scene, configuration)
        trained = prepared.train(configuration, seed=0)
        start = prepared.start
        rows = motion_rows(
            Subject(motion, 0),
            trained.renderer,
            start.clip,
            start.given,
            start.density.vertices,
            scene.truth(),
            TruthConfig(),
        )
    values: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        values.setdefault((row.method, row.metric), []).append(row.value)

    def both(metric: str) -> str:
        before, after = (np.mean(values[method, metric]) for method in ("posed_mesh", "mocoflow"))
        return f"{before:.0f} -> {after:.0f}"

    searched = "yes" if start.plan.needs("location_search") else "no"
    given, repaired = (_outline(start.clip, bodies) for bodies in (start.given, start.repaired))
    return (
        f"| {motion} | {noise.joints_deg:g} | {noise.place_cm:g} | {searched} "
        f"| {prepared.spent.cpu:.1f} | {both('keypoint_mm')} | {both('keypoint_lateral_mm')} "
        f"| {both('keypoint_depth_mm')} | {given:.3f} -> {repaired:.3f} "
        f"| {both('consensus_global_mm')} "
        f"| {trained.scores['psnr_union']:.2f} | {trained.scores['mask_iou']:.3f} |"
    )


def _outline(clip: Clip, bodies: MeshSequence) -> float:
    """Overlap of the bodies with the train camera's masks, mean over the clip."""
    shown = silhouettes(bodies.at(clip.frame_indices).vertices, bodies.faces, clip.camera)
    return float(overlap(shown, clip.masks).mean())


if __name__ == "__main__":
    main()
