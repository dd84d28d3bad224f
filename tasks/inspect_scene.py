"""Stage inspect_scene: a cheap look at what the scene brings."""

from __future__ import annotations

from mocoflow_core.artifacts import InspectionArtifact, MeshArtifact
from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.planning import inspection
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.preparation import decide_preparation
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 2  # Says of all preparation whether it is needed.


@stage(InspectionArtifact, ALGORITHM_VERSION)
def inspect_scene(
    work: Stage, recording: Source, meshes: MeshArtifact, plan: PlanConfig
) -> Summary:
    """Measures the train side on a few frames; its summary says which preparation is needed.

    Output: ``inspection.json``. A second or two.
    """
    ingested = IngestedMeshes.load(work.open(meshes))
    found = inspection.inspect_scene(open_scene(recording.path, recording.train_camera), ingested)
    (work.folder / "inspection.json").write_text(found.model_dump_json(indent=1))
    decided = decide_preparation(found, plan)
    return {
        **{decision.name: decision.needed for decision in decided},
        "warnings": list(found.warnings),
    }
