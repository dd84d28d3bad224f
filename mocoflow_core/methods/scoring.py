"""All scores of one run: pictures, motion, and the error over the training clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.methods.orbit_scores import Square, orbit_rows, rings_around
from mocoflow_core.methods.person_scores import NetworkCurve, network_rows
from mocoflow_core.methods.posed_mesh import colour_mesh
from mocoflow_core.methods.rendered_views import (
    Pictures,
    PosedMeshRenderer,
    Progress,
    Renderer,
    TrainedRenderer,
    load_clips,
    scored_views,
)
from mocoflow_core.methods.scored_views import (
    Moment,
    Subject,
    error_curve,
    few_views,
    score_views,
    side_of,
)
from mocoflow_core.methods.surface_errors import surface_rows
from mocoflow_core.methods.truth_errors import TruthConfig, motion_rows
from mocoflow_core.metrics.crop import crop_side
from mocoflow_core.metrics.curve import CurveRow, write_curve
from mocoflow_core.metrics.person_judge import PersonJudge, PersonScoreConfig, open_networks
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.metrics.table import ScoreRow, mean_scores, write_scores
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.snapshots import read_snapshots, snapshot_weights

METHODS = ("mocoflow", "posed_mesh")
MeanScores = dict[str, dict[str, dict[str, float]]]  # method, camera, metric


class Judging(NamedTuple):
    """How the scores are measured."""

    evaluating: EvaluationConfig
    person: PersonScoreConfig
    truth: TruthConfig
    up: tuple[float, ...]  # of the world


class Scored(NamedTuple):
    """Means over frames, and which scores are missing for a reason that a user can act on."""

    means: MeanScores
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class ScoringFolders:
    """Where the pieces of a run lie."""

    clip: Path
    evaluation: Path
    bodies: Path
    trained: Path
    views: Path


def score_run(
    subject: Subject,
    folders: ScoringFolders,
    before: Seconds,
    judging: Judging,
    into: Path,
    progress: Progress,
) -> Scored:
    """Write ``scores.parquet`` and ``error_curve.parquet``; give the means over frames.

    ``before`` is the training clock at the start of the optimisation.
    """
    evaluating, truth = judging.evaluating, judging.truth
    clip = Clip.load(folders.clip)
    others = load_clips(folders.evaluation)
    views = scored_views(clip, others, evaluating)
    renderer = TrainedRenderer(TrainedScene.open(folders.trained), clip)
    rendered = {method: Pictures(folders.views / method) for method in METHODS}
    rows = [
        row
        for method, pictures in rendered.items()
        for row in score_views(subject, method, views, pictures, evaluating)
    ]
    meshes = MeshSequence.load(folders.bodies / "meshes.npz")
    networks = open_networks(judging.person)
    missing = networks if isinstance(networks, str) else ""
    if not isinstance(networks, str):
        rows += network_rows(subject, rendered, views, evaluating, judging.person, networks)
        if not others:
            rows += _around(subject, renderer, clip, meshes, judging, networks.judge)
    canonical = renderer.scene.space.canonical_vertices
    truth_file = folders.evaluation / "truth.npz"
    known = truth_file if truth_file.exists() else None
    rows += motion_rows(subject, renderer, clip, meshes, canonical, known, truth)
    if known is not None:
        rows += surface_rows(subject, renderer, meshes, few_views(views, evaluating), known)
    write_scores(rows, into / "scores.parquet")
    given = Pictures(folders.views / "posed_mesh")
    moments = [Moment("posed_mesh", "ingest_meshes", 0, before.wall, before.cpu, given)]
    moments += _kept_moments(folders.trained, renderer, clip, before)
    looking = None
    if judging.person.on_curve and views and not isinstance(networks, str):
        few, side = few_views(views, evaluating), side_of(views, evaluating)
        looking = NetworkCurve(few, side, networks)
    curve = error_curve(subject, moments, views, evaluating, progress, looking)
    curve += train_rows(subject, folders.trained, before)
    write_curve(curve, into / "error_curve.parquet")
    absent = (f"no plausibility, OKS and LPIPS: {missing}",) if missing else ()
    return Scored(mean_scores(rows), absent)


def _around(
    subject: Subject,
    trained: TrainedRenderer,
    clip: Clip,
    meshes: MeshSequence,
    judging: Judging,
    judge: PersonJudge,
) -> list[ScoreRow]:
    """Scores of views from all around, for a scene that no other camera saw."""
    evaluating = judging.evaluating
    masks = clip.masks[clip.has_mask]
    side = crop_side(masks, evaluating.crop_share, evaluating.crop_box_margin)
    rings = rings_around(clip.camera, clip.frame_indices, meshes, judging.up, judging.person)
    posed = PosedMeshRenderer(colour_mesh(clip, meshes), meshes)
    renderers: dict[str, Renderer] = {"mocoflow": trained, "posed_mesh": posed}
    square = Square(side, evaluating.opacity_threshold)
    return orbit_rows(subject, renderers, rings, square, judging.person, judge)


def _kept_moments(
    trained: Path, final: TrainedRenderer, clip: Clip, before: Seconds
) -> list[Moment]:
    """The states that the optimisation kept, in the order of its clock."""
    moments = []
    for snapshot in read_snapshots(trained):
        weights = snapshot_weights(trained, snapshot)
        scene = TrainedScene.open(trained, weights, final.scene.space)
        renderer = TrainedRenderer(scene, clip)
        clock = before + Seconds(snapshot.wall_s, snapshot.cpu_s)
        state = (snapshot.step, clock.wall, clock.cpu, renderer)
        moments.append(Moment("mocoflow", "optimise_scene", *state))
    return moments


def train_rows(subject: Subject, trained: Path, before: Seconds) -> list[CurveRow]:
    """``train_psnr`` at each kept state, as it was measured when the state was taken."""
    return [
        CurveRow(
            *(subject.scene, "mocoflow", subject.seed, "optimise_scene", snapshot.step),
            *(before.wall + snapshot.wall_s, before.cpu + snapshot.cpu_s),
            *("train_psnr", snapshot.train_psnr),
        )
        for snapshot in read_snapshots(trained)
        if snapshot.train_psnr is not None
    ]
