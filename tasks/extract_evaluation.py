"""Stage extract_evaluation: what the other cameras saw, and the truth. For the metrics alone."""

from __future__ import annotations

import shutil

from mocoflow_core.artifacts import ClipArtifact, EvaluationArtifact, MeshArtifact
from mocoflow_core.body.facing import frames_that_show
from mocoflow_core.capture import extract
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import CaptureConfig
from mocoflow_core.capture.scene import open_scene
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # What is behind the person can be replaced.


@stage(EvaluationArtifact, ALGORITHM_VERSION)
def extract_evaluation(
    work: Stage,
    recording: Source,
    clip: ClipArtifact,
    capture: CaptureConfig,
    least_shown: float = 0.0,
    bodies: MeshArtifact | None = None,
) -> Summary:
    """The clip's frames as the other cameras saw them, where they have a mask to score against.

    With ``bodies`` only the frames whose body is turned as ``least_shown`` asks for.
    Output: a folder ``<camera>/`` with a clip for each camera, and ``truth.npz`` if the scene
    brings one. A few seconds.
    """
    scene = open_scene(recording.path, recording.train_camera)
    frame_indices = Clip.load(work.open(clip)).frame_indices
    only = bodies and frames_that_show(work.open(bodies), scene, least_shown)
    clips = extract.extract_evaluation(scene, frame_indices, capture, only, work.progress)
    for seen in clips:
        (work.folder / seen.camera.name).mkdir()
        seen.save(work.folder / seen.camera.name)
    if truth := scene.truth():
        shutil.copyfile(truth, work.folder / "truth.npz")
    return {
        "cameras": {seen.camera.name: seen.camera.to_json() for seen in clips},
        "truth": truth is not None,
    }
