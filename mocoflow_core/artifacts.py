"""What passes between stages: small frozen references to folders in the artifact store.

Arrays, models and pictures never travel between stages; they lie in the payload files of the
artifact, which ``Store.folder`` opens.
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import BaseModel, ConfigDict, Field, JsonValue


class Artifact(BaseModel):
    """The result of one stage: where it lies, what it cost, and a few values to decide on."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    stage: ClassVar[str]

    key: str = Field(description="content key, and the name of the artifact's folder")
    wall_s: float = Field(ge=0, description="seconds of work, earlier tries included")
    cpu_s: float = Field(ge=0, description="CPU seconds of that work")
    cached: bool = Field(False, description="found in the store instead of computed")
    summary: dict[str, JsonValue] = Field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """Findings that did not stop the stage, as sentences with the measured value."""
        found = self.summary.get("warnings", [])
        return [str(sentence) for sentence in found] if isinstance(found, list) else []

    def holds(self, name: str) -> bool:
        """Whether the summary states ``name`` as true."""
        return self.summary.get(name) is True


class InspectionArtifact(Artifact):
    stage = "inspect_scene"


class ClipArtifact(Artifact):
    stage = "extract_clip"


class EvaluationArtifact(Artifact):
    """What the other cameras saw, with the truth: for the metrics alone."""

    stage = "extract_evaluation"


class MeshArtifact(Artifact):
    stage = "ingest_meshes"


class LocationArtifact(Artifact):
    """The meshes in world metres, searched or taken over."""

    stage = "locate_body"


class RepairArtifact(Artifact):
    """The meshes bent towards the masks: what training starts from."""

    stage = "repair_body"


class PlanArtifact(Artifact):
    stage = "plan_scene"


class DensityArtifact(Artifact):
    stage = "pretrain_density"


class MotionArtifact(Artifact):
    stage = "fit_motion"


class SceneArtifact(Artifact):
    """The trained scene."""

    stage = "optimise_scene"


class ViewsArtifact(Artifact):
    stage = "render_views"


class ScoresArtifact(Artifact):
    stage = "score_views"


class ReportArtifact(Artifact):
    stage = "write_report"


class MisplacedViewsArtifact(Artifact):
    """A scene's photographs scored against themselves, moved and turned."""

    stage = "misplace_views"


class CellTablesArtifact(Artifact):
    """The tables of all cells of a benchmark."""

    stage = "collect_cells"


class BenchmarkArtifact(Artifact):
    """Chart and page of a benchmark."""

    stage = "write_benchmark"
