"""The content of ``scene.json``, as written; numbers are checked when the scene is opened."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mocoflow_core.capture.names import FolderName, OneLine
from mocoflow_core.errors import InputError

BehindPerson = Literal["kept", "plate", "white"]
# Of meshes; "camera" is the train camera, and its axes alone where they are root-centred.
Coordinates = Literal["world", "camera", "camera-root-centred"]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class WorldDescription(_Part):
    """Unit and direction of up of the world's axes."""

    unit: Literal["m"]
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class CameraDescription(_Part):
    """Calibration of one camera and where its pictures lie; paths relative to the scene."""

    width: int = Field(gt=0)
    height: int = Field(gt=0)
    K: list[list[float]]
    distortion: list[float] = [0.0] * 5
    R: list[list[float]]
    t: list[float]
    frames: str
    masks: str | None = None
    background: str | None = None


class MeshesDescription(_Part):
    """The body mesh estimate: file, axes, and whether its translation can be trusted."""

    file: str
    coordinates: Coordinates
    located: bool
    source: str = ""


class TruthDescription(_Part):
    """Exact bodies or keypoints; the metrics alone read them."""

    file: str


class SceneDescription(_Part):
    """The content of ``scene.json``."""

    format: Literal["mocoflow-scene"]
    version: Literal[1]
    name: OneLine
    fps: float = Field(gt=0, allow_inf_nan=False)
    working_fps: float = Field(
        12.0, gt=0, allow_inf_nan=False, description="Rate to learn from; the paper's (sec. 4)."
    )
    source_begins_at: int | None = Field(
        None,
        ge=0,
        description="Where frames were cut out of a longer recording and keep its numbers: the "
        "number of its first frame. Null: the frames are all there is.",
    )
    world: WorldDescription
    train_camera: str
    cameras: dict[FolderName, CameraDescription]
    behind_person: BehindPerson = Field(
        "kept", description="What capture.behind_person is where it says nothing."
    )
    meshes: MeshesDescription | None = None
    truth: TruthDescription | None = None
    license: str = ""
    attribution: str = ""
    remarks: list[str] = Field([], description="For whoever reads the scores; on the report.")


def read_description(file: Path) -> SceneDescription:
    """Parse ``scene.json``. Raises InputError when it does not follow the format."""
    try:
        return SceneDescription.model_validate(json.loads(file.read_text(encoding="utf-8")))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError("scene.json must be JSON", str(error), "Correct its syntax.") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(step) for step in first["loc"]) or "its root"
        raise InputError(
            f"scene.json must follow the scene format at {where}",
            f"{first.get('input')!r:.80} ({first['msg']})",
            "Compare it with the scene format in the README.",
        ) from error
