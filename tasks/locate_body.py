"""Stage locate_body: where a body without a trusted location stands, found from the masks."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, LocationArtifact, MeshArtifact
from mocoflow_core.body import location
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.capture.clip import Clip
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 5  # Tells how badly the given location explained the masks.


@stage(LocationArtifact, ALGORITHM_VERSION)
def locate_body(
    work: Stage, clip: ClipArtifact, meshes: MeshArtifact, search: LocationConfig
) -> Summary:
    """The location search (MoCo-Flow sec. 3.1).

    Output: ``meshes.npz`` in world metres and ``location.npz`` with each frame's residual and
    confidence. About 0.1 s a frame.
    """
    located = location.locate_body(
        Clip.load(work.open(clip)), IngestedMeshes.load(work.open(meshes)), search, work.progress
    )
    located.save(work.folder)
    return {
        "quality": located.quality,
        "adopted": located.adopted,
        "warnings": list(located.warnings),
    }
