"""Stage ingest_meshes: an estimator's output as one checked mesh sequence."""

from __future__ import annotations

from mocoflow_core.artifacts import MeshArtifact
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.estimators import ingest
from mocoflow_core.estimators.configuration import EstimateConfig
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Faces wind outwards; frozen and flipping estimates are noticed.


@stage(MeshArtifact, ALGORITHM_VERSION)
def ingest_meshes(
    work: Stage,
    recording: Source,
    meshes: Source | None,
    body_model: Source | None,
    faces: Source | None,
    estimate: EstimateConfig,
) -> Summary:
    """A body mesh for each source frame, its coordinates stated.

    Output: ``meshes.npz``, ``ingested.json`` and, where it is known about where root-centred
    bodies stand, ``first_translations.npy``. Seconds where bodies are posed, else below one.
    """
    scene = open_scene(recording.path, recording.train_camera)
    chosen = estimate.with_files(
        body_model.path if body_model else None, faces.path if faces else None
    )
    path = meshes.path if meshes else None
    ingested = ingest.ingest_meshes(scene, path, chosen, work.progress)
    ingested.save(work.folder)
    return {
        "coordinates": ingested.coordinates,
        "located": ingested.located,
        "warnings": list(ingested.warnings),
    }
