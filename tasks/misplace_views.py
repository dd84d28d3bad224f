"""Stage misplace_views: photographs of a scene against themselves, moved and turned."""

from __future__ import annotations

from mocoflow_core.artifacts import MisplacedViewsArtifact
from mocoflow_core.capture.extract import CaptureConfig
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.methods.misplaced_views import misplaced_view_rows
from mocoflow_core.metrics.person_judge import PersonScoreConfig
from mocoflow_core.metrics.score import EvaluationConfig
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 3  # Views without a pose are none of OKS.


@stage(MisplacedViewsArtifact, ALGORITHM_VERSION)
def misplace_views(
    work: Stage,
    recording: Source,
    others: Source,
    name: str,
    capture: CaptureConfig,
    evaluation: EvaluationConfig,
    person: PersonScoreConfig,
) -> Summary:
    """What the scores make of a misplaced view (MoCo-Flow Table 1). Nothing is learned.

    Output: in its summary. Some seconds; a minute with networks. ``others`` are the files of
    the same scene that metrics read.
    """
    scene = open_scene(recording.path, recording.train_camera)
    rows = misplaced_view_rows(scene, name, capture, evaluation, person, work.progress)
    return {"rows": [row._asdict() for row in rows]}
