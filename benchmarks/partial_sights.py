"""Synthetic recordings of which the train camera sees only a part."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.io.pictures import read_picture, write_picture


def keep_first_frames(folder: Path, count: int) -> None:
    """Cut a scene's clip off after ``count`` frames, in all cameras; its truth goes."""
    for picture in (*folder.glob("frames/*/*"), *folder.glob("masks/*/*")):
        if int(picture.stem) >= count:
            picture.unlink()
    meshes = MeshSequence.load(folder / "meshes.npz")
    kept = meshes.frame_indices < count
    replace(meshes, frame_indices=meshes.frame_indices[kept], vertices=meshes.vertices[kept]).save(
        folder / "meshes.npz"
    )
    _drop_truth(folder)


def narrow_train_camera(folder: Path, left: int, right: int) -> None:
    """Leave columns ``left`` to ``right`` (pixels, exclusive) of the train camera's pictures."""
    description = json.loads((folder / "scene.json").read_text())
    camera = description["cameras"][description["train_camera"]]
    for picture in _pictures(folder, description["train_camera"]):
        write_picture(picture, np.ascontiguousarray(read_picture(picture)[:, left:right]))
    camera["width"] = right - left
    camera["K"][0][2] -= left
    (folder / "scene.json").write_text(json.dumps(description))


def _pictures(folder: Path, camera: str) -> Iterable[Path]:
    yield from folder.glob(f"frames/{camera}/*")
    yield from folder.glob(f"masks/{camera}/*")
    yield folder / "background" / f"{camera}.png"


def _drop_truth(folder: Path) -> None:
    description = json.loads((folder / "scene.json").read_text())
    description.pop("truth", None)
    (folder / "scene.json").write_text(json.dumps(description))
