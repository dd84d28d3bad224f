"""An opened scene folder: its cameras, and the files behind each part."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.calibration import require_calibration
from mocoflow_core.capture.frame_source import (
    FrameSource,
    numbered_images,
    open_frame_source,
)
from mocoflow_core.capture.scene_description import (
    CameraDescription,
    SceneDescription,
    read_description,
)
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera

UP_VECTORS = {
    sign + axis: (1.0 if sign == "+" else -1.0) * np.eye(3)[row]
    for row, axis in enumerate("xyz")
    for sign in "+-"
}


@dataclass(frozen=True, eq=False)
class Scene:
    """An opened scene folder. Nothing but the description has been read."""

    root: Path
    description: SceneDescription
    cameras: dict[str, Camera]  # at the size of the files, distortion included
    train_camera: str  # the description's, or another one that was asked for

    @property
    def meshes_for(self) -> str:
        """The camera that the scene's own meshes were given for."""
        return self.description.train_camera

    @property
    def is_seen_from_elsewhere(self) -> bool:
        """Whether another camera than the description's is trained on."""
        return self.train_camera != self.meshes_for

    @property
    def evaluation_cameras(self) -> list[str]:
        return sorted(name for name in self.cameras if name != self.train_camera)

    @property
    def up(self) -> NDArray[np.float64]:
        """Unit vector (3,) of up in the world."""
        return UP_VECTORS[self.description.world.up]

    def frames(self, camera: str) -> FrameSource:
        """The frames of a camera, by source number."""
        where = self.root / self.description.cameras[camera].frames
        return open_frame_source(where, f"frames of {camera}")

    def masks(self, camera: str) -> dict[int, Path]:
        """Mask files of a camera by source number; empty when the scene brings none."""
        where = self.description.cameras[camera].masks
        return numbered_images(self.root / where, f"masks of {camera}") if where else {}

    def background(self, camera: str) -> Path | None:
        """The background plate of a camera, if the scene brings one."""
        where = self.description.cameras[camera].background
        return self.root / where if where else None

    def meshes(self) -> Path | None:
        """The body mesh file, if the scene brings one."""
        return self.root / self.description.meshes.file if self.description.meshes else None

    def truth(self) -> Path | None:
        """The truth file, for metrics alone."""
        return self.root / self.description.truth.file if self.description.truth else None

    def training_description(self) -> dict[str, Any]:
        """What the training side knows of ``scene.json``: no other camera, no truth, no names."""
        known = {"format", "version", "fps", "working_fps", "world", "train_camera", "meshes"}
        values = self.description.model_dump(mode="json", include=known)
        camera = self.description.cameras[self.train_camera]
        values |= {"train_camera": self.train_camera, "camera": camera.model_dump(mode="json")}
        stated = self.description.model_dump(include={"source_begins_at", "behind_person"})
        values |= {name: value for name, value in stated.items() if value not in (None, "kept")}
        # What was estimated for another camera is known to be so.
        return values | ({"meshes_for": self.meshes_for} if self.is_seen_from_elsewhere else {})

    def evaluation_description(self) -> dict[str, Any]:
        """The rest that scores depend on: the other cameras and the truth."""
        cameras = self.description.cameras
        return {
            "cameras": {
                name: cameras[name].model_dump(mode="json") for name in self.evaluation_cameras
            },
            "truth": self.description.truth.model_dump() if self.description.truth else None,
        }

    def source_files(self) -> list[Path]:
        """Every file the training side reads, apart from ``scene.json``."""
        meshes = self.meshes()
        return self._camera_files(self.train_camera) + ([meshes] if meshes else [])

    def evaluation_files(self) -> list[Path]:
        """Every further file the metrics read: the other cameras' and the truth."""
        files = [file for name in self.evaluation_cameras for file in self._camera_files(name)]
        truth = self.truth()
        return files + ([truth] if truth else [])

    def _camera_files(self, camera: str) -> list[Path]:
        background = self.background(camera)
        masks = self.masks(camera)
        files = [*self.frames(camera).files, *(masks[index] for index in sorted(masks))]
        return files + ([background] if background else [])


def open_scene(path: Path, train_camera: str | None = None) -> Scene:
    """Read and validate ``scene.json`` of a folder (or given itself).

    Args:
        train_camera: another camera to train on; the description's then is one that evaluates.

    Raises InputError for an unreadable description, a matrix that is no rotation, non-finite
    values or impossible intrinsics, and for files that are named but not there.
    """
    file = path if path.name == "scene.json" else path / "scene.json"
    if not file.is_file():
        raise InputError(
            "a scene folder with a scene.json", f"{path}", "Check the path of the scene."
        )
    description = read_description(file)
    for name in (description.train_camera, train_camera or description.train_camera):
        if name not in description.cameras:
            raise InputError(
                "train_camera must be one of the scene's cameras",
                f"{name!r} among {', '.join(description.cameras)}",
                f"Correct {'scene.json' if name != train_camera else 'capture.train_camera'}.",
            )
    cameras = {name: _camera(name, part) for name, part in description.cameras.items()}
    scene = Scene(file.parent, description, cameras, train_camera or description.train_camera)
    _require_files(scene)
    return scene


def _camera(name: str, part: CameraDescription) -> Camera:
    camera = Camera(
        name=name,
        width=part.width,
        height=part.height,
        K=_array(part.K, (3, 3), f"K of {name}"),
        R=_array(part.R, (3, 3), f"R of {name}"),
        t=_array(part.t, (3,), f"t of {name}"),
        distortion=_array(part.distortion, (5,), f"distortion of {name}"),
    )
    require_calibration(camera, "scene.json")
    return camera


def _array(values: object, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except ValueError:
        array = np.empty(0)
    if array.shape != shape:
        size = " x ".join(map(str, shape))
        raise InputError(
            f"{what} must have {size} numbers", f"{values!r:.60}", "Correct scene.json."
        )
    if not np.isfinite(array).all():
        raise InputError(f"{what} must be finite", f"{array.tolist()}", "Correct scene.json.")
    return array


def _require_files(scene: Scene) -> None:
    """Named files must exist. Other cameras are checked too: a half scene is a user's mistake."""
    for name, part in scene.description.cameras.items():
        for what in ("frames", "masks", "background"):
            _require(scene.root, getattr(part, what), f"{what} of {name}")
    for what, given in (("meshes", scene.description.meshes), ("truth", scene.description.truth)):
        _require(scene.root, given.file if given else None, what)


def _require(root: Path, where: str | None, what: str) -> None:
    if where is not None and not (root / where).exists():
        raise InputError(
            f"{what} must exist", f"nothing at {where}", "Add it or correct scene.json."
        )
