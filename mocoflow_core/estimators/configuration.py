"""How the file of a body estimator is read."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from mocoflow_core.capture.scene_description import Coordinates
from mocoflow_core.configuration import ConfigurationPart

Kind = Literal[
    "native",
    "vibe",
    "pare",
    "wham",
    "phalp",
    "gvhmr",
    "tram",
    "romp",
    "aist_motion",
    "easymocap",
    "mesh_folder",
]


class EstimateConfig(ConfigurationPart):
    """What a file of body meshes does not say itself, or what shall be chosen from it."""

    kind: Kind | Literal["auto"] = Field("auto", description="Tool; auto: told by the content.")
    person: int | None = Field(None, description="Id of the person; null: the longest track.")
    body_model: Path | None = Field(
        None,
        description="SMPL or SMPL-X of the user's: a .pkl or .npz file, or a folder of them.",
    )
    faces: Path | None = Field(
        None, description="Mesh file whose faces the estimate shares, where no model is at hand."
    )
    shape: Literal["median", "per_frame"] = Field(
        "median", description="One body shape for the person, or the estimate's own in each frame."
    )
    crop_factor: float | None = Field(
        None,
        gt=0,
        description="Side of the square that the network saw, times the stored box; null: the "
        "tool's (VIBE 1.1, PARE 1).",
    )
    focal_px: float | None = Field(
        None, gt=0, description="Focal length that the tool worked with; null: what it always has."
    )
    first_frame: int = Field(
        0, ge=0, description="Frames of the video before the first one that the tool was given."
    )
    pose_blend_shapes: Literal["on", "off"] = Field(
        "on", description="Off for bodies fitted without them: Neural Body's old params."
    )
    coordinates: Coordinates | None = Field(
        None, description="Where the meshes of a folder stand; null: what scene.json says."
    )

    def without_files(self) -> EstimateConfig:
        """The same without paths: files count by their content."""
        return self.with_files(None, None)

    def with_files(self, body_model: Path | None, faces: Path | None) -> EstimateConfig:
        """The same with these files."""
        return self.model_copy(update={"body_model": body_model, "faces": faces})
