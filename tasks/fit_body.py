"""Stage fit_body: a body for a clip that came without one."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, FittedBodyArtifact
from mocoflow_core.body.fit.fit_body import BodyFitConfig, fit_to_clip
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.capture.clip import Clip
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 1


@stage(FittedBodyArtifact, ALGORITHM_VERSION)
def fit_body(work: Stage, clip: ClipArtifact, landmarks: Source, fit: BodyFitConfig) -> Summary:
    """Anny fitted to landmarks of the clip's own pictures and to its masks.

    ``landmarks`` is the file that ``Sightings.load`` reads, a row for each frame of the clip.
    Output: ``meshes.npz`` in world metres, ``fit.npz``. About 0.1 s a frame.
    """
    seen = Sightings.load(landmarks.path)
    fitted = fit_to_clip(seen, Clip.load(work.open(clip)), fit, work.progress)
    fitted.save(work.folder)
    return {
        "readings": dict(fitted.readings),
        "silhouette_iou": fitted.usual_overlap,
        "warnings": list(fitted.warnings),
    }
