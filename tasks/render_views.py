"""Stage render_views: the scored views of every method, a side view and a turntable."""

from __future__ import annotations

import json

from mocoflow_core.artifacts import (
    ClipArtifact,
    EvaluationArtifact,
    LocationArtifact,
    MeshArtifact,
    PlanArtifact,
    SceneArtifact,
    ViewsArtifact,
)
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.methods.correspondence_pictures import write_correspondences
from mocoflow_core.methods.posed_mesh import colour_mesh
from mocoflow_core.methods.presentation import (
    PresentationConfig,
    render_side_view,
    render_turntable,
)
from mocoflow_core.methods.rendered_views import (
    PosedMeshRenderer,
    TrainedRenderer,
    load_clips,
    scored_views,
)
from mocoflow_core.methods.rendered_views import (
    render_views as render,
)
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.rendering.trained_scene import TrainedScene
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Correspondences.


@stage(ViewsArtifact, ALGORITHM_VERSION)
def render_views(
    work: Stage,
    trained: SceneArtifact,
    plan: PlanArtifact,
    clip: ClipArtifact,
    evaluation: EvaluationArtifact,
    bodies: MeshArtifact | LocationArtifact,
    evaluating: EvaluationConfig,
    presentation: PresentationConfig,
) -> Summary:
    """Pictures of the trained scene and of the posed mesh, at the same views.

    Output: ``<method>/views/<camera>/%06d.png`` with ``opacity`` beside ``views``,
    ``side/%06d.png``, ``correspondences/%06d.png``, ``turntable.mp4``. A second or so for
    each view.
    """
    seen = Clip.load(work.open(clip))
    meshes = MeshSequence.load(work.open(bodies) / "meshes.npz")
    views = scored_views(seen, load_clips(work.open(evaluation)), evaluating)
    scene = TrainedScene.open(work.open(trained))
    baseline = PosedMeshRenderer(colour_mesh(seen, meshes), meshes)
    up = clip.summary["up"]
    render(TrainedRenderer(scene, seen), views, work.folder / "mocoflow", work.part(0.0, 0.4))
    render(baseline, views, work.folder / "posed_mesh", work.part(0.4, 0.5))
    side, turntable = work.folder / "side", work.folder / "turntable.mp4"
    canonical = json.loads((work.open(plan) / "plan.json").read_text())["canonical_frame"]
    chosen = (canonical, presentation.correspondence_frames, work.folder / "correspondences")
    render_side_view(scene, seen, up, presentation, side, work.part(0.5, 0.7))
    write_correspondences(scene, seen, *chosen, work.part(0.7, 0.75))
    render_turntable(scene, seen, up, presentation, turntable, work.part(0.75, 1.0))
    return {
        "views": len(views),
        "side_view": f"{presentation.side_deg:g} degrees to the side",
        "canonical_frame": canonical,
    }
