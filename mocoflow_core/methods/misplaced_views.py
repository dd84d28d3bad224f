"""A scene's own photographs, misplaced and scored: what its scores can tell apart."""

from __future__ import annotations

import numpy as np

from mocoflow_core.capture.extract import (
    CaptureConfig,
    extract_clip,
    extract_evaluation,
    select_training_frames,
)
from mocoflow_core.capture.scene import Scene
from mocoflow_core.methods.rendered_views import scored_views
from mocoflow_core.methods.scored_views import side_of
from mocoflow_core.metrics.misalignment import MisalignmentRow, misalignment_rows
from mocoflow_core.metrics.score import EvaluationConfig


def misplaced_view_rows(
    scene: Scene, name: str, capture: CaptureConfig, evaluating: EvaluationConfig
) -> list[MisalignmentRow]:
    """Rows of the views that a run would be scored on: other cameras', or held-out frames."""
    clip = extract_clip(scene, capture)
    frames = select_training_frames(scene, capture).all
    views = scored_views(clip, extract_evaluation(scene, frames, capture), evaluating)
    pictures = [
        (np.asarray(view.clip.frames[view.row]), np.asarray(view.clip.masks[view.row]))
        for view in views
    ]
    return misalignment_rows(name, pictures, side_of(views, evaluating), evaluating)
