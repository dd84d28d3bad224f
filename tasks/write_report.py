"""Stage write_report: one self-contained page about the run."""

from __future__ import annotations

import json

from mocoflow_core.artifacts import (
    ClipArtifact,
    EvaluationArtifact,
    PlanArtifact,
    ReportArtifact,
    SceneArtifact,
    ScoresArtifact,
    ViewsArtifact,
)
from mocoflow_core.report.curve_picture import write_curve_picture
from mocoflow_core.report.inputs import ReportInputs
from mocoflow_core.report.page import write_report as write
from tasks.stage import Aside, Stage, Summary, stage

ALGORITHM_VERSION = 7  # Photographs as they are, and shifted; networks along the curve.


@stage(ReportArtifact, ALGORITHM_VERSION)
def write_report(
    work: Stage,
    run: Aside,
    clip: ClipArtifact,
    evaluation: EvaluationArtifact,
    plan: PlanArtifact,
    trained: SceneArtifact,
    views: ViewsArtifact,
    scores: ScoresArtifact,
) -> Summary:
    """Input beside novel view, held-out views beside their photographs, scores, omissions, times.

    Output: ``report.html``, and ``error_curve.png`` for Prefect's pages. A few seconds.
    """
    rendered = work.open(views)
    inputs = ReportInputs(
        run=run.values,
        decisions=json.loads((work.open(plan) / "plan.json").read_text())["decisions"],
        scores=work.open(scores) / "scores.parquet",
        curve=work.open(scores) / "error_curve.parquet",
        train_clip=work.open(clip),
        evaluation=work.open(evaluation),
        views=rendered / "mocoflow" / "views",
        baseline_views=rendered / "posed_mesh" / "views",
        novel_camera=str(views.summary["side_view"]),
        novel_view=rendered / "side",
        correspondences=rendered / "correspondences",
        canonical_frame=views.summary["canonical_frame"],
        turntable=rendered / "turntable.mp4",
        warnings=[str(warning) for warning in run.values.get("warnings", ())],
        guard_events=[str(event) for event in trained.summary["events"]],
        held_out=str(trained.summary["held_out"]),
    )
    write(inputs, work.folder / "report.html")
    picture = work.folder / "error_curve.png"
    write_curve_picture(inputs.curve, run.values["stages"], inputs.method, picture)
    return {"picture": picture.exists()}
