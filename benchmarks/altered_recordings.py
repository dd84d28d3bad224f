"""Synthetic recordings with a fault: stills, a lamp that dims, a misplaced estimate."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocoflow_core.body.light import linear_light
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.io.pictures import read_picture, write_picture
from mocoflow_core.synthetic.texture import encode_srgb


def show_again(folder: Path, times: int) -> None:
    """Each frame of the train camera ``times`` times in a row; the others keep one; truth goes."""
    description = json.loads((folder / "scene.json").read_text())
    for files in (*folder.glob("frames/*"), *folder.glob("masks/*")):
        copies = times if files.name == description["train_camera"] else 1
        for file in sorted(files.iterdir(), reverse=True):
            number, suffix = times * int(file.stem), file.suffix
            picture = file.read_bytes()
            file.unlink()
            for copy in range(copies):
                (files / f"{number + copy:06d}{suffix}").write_bytes(picture)
    meshes = MeshSequence.load(folder / "meshes.npz")
    again = np.arange(times * len(meshes.vertices), dtype=np.int32)
    meshes = replace(meshes, frame_indices=again, vertices=meshes.vertices[again // times])
    meshes.save(folder / "meshes.npz")
    description.pop("truth", None)
    (folder / "scene.json").write_text(json.dumps(description))


def dim_lamp(folder: Path, share: float) -> None:
    """A lamp on the person goes up and down twice, by a share of its light, for all cameras."""
    pictures = sorted(folder.glob("frames/*/*"))
    last = max(int(picture.stem) for picture in pictures)
    for picture in pictures:
        person = read_picture(folder / "masks" / picture.parent.name / picture.name)
        covered = (person.reshape(*person.shape[:2], -1)[..., :1] > 127).astype(np.float64)
        phase = 4 * np.pi * int(picture.stem) / max(last, 1)
        light = linear_light(read_picture(picture)) * (1 + share * np.sin(phase) * covered)
        write_picture(picture, encode_srgb(light.clip(0, 1)))


def misplace_bodies(folder: Path, offset_m: tuple[float, float, float]) -> None:
    """The estimate stands somewhere else, world metres."""
    meshes = MeshSequence.load(folder / "meshes.npz")
    moved = meshes.vertices + np.asarray(offset_m, np.float32)
    replace(meshes, vertices=moved).save(folder / "meshes.npz")
