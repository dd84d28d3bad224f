"""Stage ingest_meshes: an estimator's output as one checked mesh sequence."""

from __future__ import annotations

from mocoflow_core.artifacts import MeshArtifact
from mocoflow_core.body import ingest
from mocoflow_core.capture.scene import open_scene
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Faces wind outwards; frozen and flipping estimates are noticed.


@stage(MeshArtifact, ALGORITHM_VERSION)
def ingest_meshes(work: Stage, recording: Source, meshes: Source | None) -> Summary:
    """A body mesh for each source frame, its coordinates stated.

    Output: ``meshes.npz`` and ``ingested.json``. Below a second.
    """
    scene = open_scene(recording.path, recording.train_camera)
    ingested = ingest.ingest_meshes(scene, meshes.path if meshes else None)
    ingested.save(work.folder)
    return {
        "coordinates": ingested.coordinates,
        "located": ingested.located,
        "warnings": list(ingested.warnings),
    }
