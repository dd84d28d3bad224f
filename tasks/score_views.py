"""Stage score_views: the table of scores, the error curve, the distances to the truth."""

from __future__ import annotations

from mocoflow_core.artifacts import (
    ClipArtifact,
    EvaluationArtifact,
    LocationArtifact,
    MeshArtifact,
    SceneArtifact,
    ScoresArtifact,
    ViewsArtifact,
)
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.methods.scoring import Judging, ScoringFolders, score_run
from mocoflow_core.methods.truth_errors import TruthConfig
from mocoflow_core.metrics.person_judge import PersonScoreConfig
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.training.clock import Seconds
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 5  # The photographs as they are, and shifted.


@stage(ScoresArtifact, ALGORITHM_VERSION)
def score_views(
    work: Stage,
    scene: str,
    seed: int,
    views: ViewsArtifact,
    trained: SceneArtifact,
    clip: ClipArtifact,
    evaluation: EvaluationArtifact,
    bodies: MeshArtifact | LocationArtifact,
    evaluating: EvaluationConfig,
    person: PersonScoreConfig,
    truth: TruthConfig,
) -> Summary:
    """Scores as in the paper's sec. 4, for the trained scene and for the posed mesh.

    Plausibility, OKS and LPIPS also of the photographs: the most that a render could reach.

    Output: ``scores.parquet``, ``error_curve.parquet``. Seconds to minutes: the curve renders a
    few views at each kept state.
    """
    folders = ScoringFolders(
        clip=work.open(clip),
        evaluation=work.open(evaluation),
        bodies=work.open(bodies),
        trained=work.open(trained),
        views=work.open(views),
    )
    subject = Subject(scene, seed)
    before = Seconds(trained.summary["before_wall_s"], trained.summary["before_cpu_s"])
    judging = Judging(evaluating, person, truth, tuple(clip.summary["up"]))
    scored = score_run(subject, folders, before, judging, work.folder, work.progress)
    return {"mean": scored.means, "warnings": list(scored.warnings)}
