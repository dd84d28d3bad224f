"""A data set, once read, written as a native scene folder."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.frame_source import ImageFrames
from mocoflow_core.capture.scene_description import (
    CameraDescription,
    MeshesDescription,
    SceneDescription,
    TruthDescription,
    WorldDescription,
)
from mocoflow_core.datasets.dataset_scene import DatasetCamera, DatasetScene, DatasetTruth
from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.progress import Progress

# What was imported, how, and what was found; for people, nothing reads it back.
IMPORT_RECORD = "import.json"
_COMPRESSION = [cv2.IMWRITE_PNG_COMPRESSION, 1]  # Fast; a third larger than the smallest.


def write_dataset(
    scene: DatasetScene,
    folder: Path,
    record: Mapping[str, object] | None = None,
    progress: Progress | None = None,
) -> None:
    """Write frames, masks, plates, meshes, truth and scene.json; whole or not at all.

    Picture files to which nothing is done are linked, or copied byte for byte where another disk
    forbids it; frames of videos and changed ones become PNG. ``record`` goes to ``import.json``.

    Raises InputError if the folder holds anything already, and where the disk is full.
    """
    require_new(folder)
    with full_disk_is_bad_input(f"The folder {folder}"), _appearing(folder) as beside:
        steps = _Steps(scene, progress)
        cameras = {
            name: _write_camera(beside, name, camera, steps)
            for name, camera in scene.cameras.items()
        }
        description = _describe(scene, cameras)
        if scene.meshes:
            scene.meshes.sequence.save(beside / "meshes.npz")
        if scene.truth:
            _write_truth(beside / "truth.npz", scene.truth)
        if record is not None:
            (beside / IMPORT_RECORD).write_text(json.dumps(record, indent=1) + "\n")
        text = description.model_dump_json(indent=1, exclude_none=True)
        (beside / "scene.json").write_text(text + "\n")


def require_new(folder: Path) -> None:
    """Raise InputError if the folder is not a new or empty one."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(
            "A scene is written into a new or empty folder",
            f"{folder} with content",
            "Choose another folder or empty it first.",
        )


class _Steps:
    """How far the writing is, in pictures."""

    def __init__(self, scene: DatasetScene, progress: Progress | None) -> None:
        self._total = sum(
            len(camera.frames.indices) + (len(camera.masks.indices) if camera.masks else 0)
            for camera in scene.cameras.values()
        )
        self._done, self._progress = 0, progress

    def done(self, text: str) -> None:
        self._done += 1
        if self._progress:
            self._progress(self._done / self._total, text)


@contextmanager
def _appearing(folder: Path) -> Iterator[Path]:
    """A folder beside the wanted one, which it becomes once the block is done."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        yield beside
        beside.chmod(0o755)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)  # Gone already where all went well.


def _write_camera(
    folder: Path, name: str, camera: DatasetCamera, steps: _Steps
) -> CameraDescription:
    frames = folder / "frames" / name
    frames.mkdir(parents=True)
    if isinstance(camera.frames, ImageFrames):
        for number, file in camera.frames.images.items():
            _link(file, frames / f"{number:06d}{file.suffix.lower()}")
            steps.done(name)
    else:
        for number, image in camera.frames.read(camera.frames.indices.tolist()):
            _write_png(frames / f"{number:06d}.png", image[..., ::-1])
            steps.done(name)
    described = {"frames": f"frames/{name}"}
    if camera.masks:
        described["masks"] = f"masks/{name}"
        (folder / "masks" / name).mkdir(parents=True)
        for number, mask in camera.masks.read(camera.masks.indices.tolist()):
            white = mask.astype(np.uint8) * np.uint8(255)
            _write_png(folder / "masks" / name / f"{number:06d}.png", white)
            steps.done(name)
    if camera.background is not None:
        described["background"] = f"background/{name}.png"
        (folder / "background").mkdir(exist_ok=True)
        _write_png(folder / described["background"], camera.background[..., ::-1])
    return CameraDescription.model_validate(camera.camera.to_json() | described)


def _describe(scene: DatasetScene, cameras: dict[str, CameraDescription]) -> SceneDescription:
    meshes, truth = scene.meshes, scene.truth
    rate = {} if scene.working_fps is None else {"working_fps": scene.working_fps}
    return SceneDescription(
        format="mocoflow-scene",
        version=1,
        name=scene.name,
        fps=scene.fps,
        **rate,
        behind_person=scene.behind_person,
        source_begins_at=scene.source_begins_at,
        world=WorldDescription(unit="m", up=scene.up),
        train_camera=scene.train_camera,
        cameras=cameras,
        meshes=MeshesDescription(
            file="meshes.npz",
            coordinates=meshes.coordinates,
            located=meshes.located,
            source=meshes.source,
        )
        if meshes
        else None,
        truth=TruthDescription(file="truth.npz") if truth else None,
        license=scene.license,
        attribution=scene.attribution,
        remarks=list(scene.caveats),
    )


def _write_truth(path: Path, truth: DatasetTruth) -> None:
    arrays = {
        "frame_indices": truth.frame_indices,
        "vertices": truth.vertices,
        "faces": truth.faces,
        "keypoints3d": truth.keypoints3d,
    }
    with path.open("wb") as file:
        np.savez(file, **{name: array for name, array in arrays.items() if array is not None})  # type: ignore[arg-type]


def _link(file: Path, target: Path) -> None:
    """The same bytes under another name."""
    try:
        os.link(file.resolve(), target)
    except OSError:  # Another disk, or one that knows no links.
        shutil.copyfile(file, target)


def _write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    encoded = cv2.imencode(".png", np.ascontiguousarray(pixels), _COMPRESSION)[1]
    path.write_bytes(encoded.tobytes())
