"""A scene's own photographs, misplaced and scored: what its scores can tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.extract import (
    CaptureConfig,
    extract_clip,
    extract_evaluation,
    select_training_frames,
)
from mocoflow_core.capture.scene import Scene
from mocoflow_core.methods.rendered_views import ScoredView, scored_views
from mocoflow_core.methods.scored_views import few_views, side_of
from mocoflow_core.metrics.misalignment import MisalignmentRow, misalignment_rows
from mocoflow_core.metrics.misplaced_persons import misplaced_person_rows
from mocoflow_core.metrics.person_judge import PersonScoreConfig, open_networks
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.progress import Progress, part_of, untold


def misplaced_view_rows(
    scene: Scene,
    name: str,
    capture: CaptureConfig,
    evaluating: EvaluationConfig,
    person: PersonScoreConfig,
    progress: Progress = untold,
) -> list[MisalignmentRow]:
    """Rows of the views that a run would be scored on: other cameras', or held-out frames.

    The networks look at the few views of the error curve.
    """
    clip = extract_clip(scene, capture, progress=part_of(progress, 0.0, 0.2))
    frames = select_training_frames(scene, capture).all
    others = extract_evaluation(scene, frames, capture, progress=part_of(progress, 0.2, 0.4))
    views = scored_views(clip, others, evaluating)
    side = side_of(views, evaluating)
    rows = misalignment_rows(name, _photographs(views), side, evaluating)
    networks = open_networks(person)
    if not isinstance(networks, str):
        few = _photographs(few_views(views, evaluating))
        looking = part_of(progress, 0.4, 1.0)
        rows += misplaced_person_rows(name, few, side, evaluating, networks, looking)
    return rows


def _photographs(views: Sequence[ScoredView]) -> list[tuple[NDArray[np.uint8], NDArray[np.bool_]]]:
    return [
        (np.asarray(view.clip.frames[view.row]), np.asarray(view.clip.masks[view.row]))
        for view in views
    ]
