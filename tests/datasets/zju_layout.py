"""Writes ZJU-MoCap's layout, as Neural Body released it, from a synthetic studio."""

from __future__ import annotations

import json
import pickle
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import cv2
import numpy as np
import trimesh

from tests.datasets.studio import Studio


@dataclass(frozen=True)
class ZjuLayout:
    """One of the variants; tests change a field to plant a trap."""

    annotations: str = "annots.npy"
    nested_lists: bool = False  # as in 313 and 315
    time_stamped: bool = False  # so are the names of these
    first_number: int = 0
    keypoints: bool = False
    unit_m: float = 0.001
    mask_folders: tuple[str, ...] = ("mask", "mask_cihp")
    body_folders: tuple[str, ...] = ("new_vertices",)
    body_number_offset: int = 0


AS_RELEASED = ZjuLayout()
# At sizes this small, halved colour resolution would leave nothing to compare.
_JPEG = [
    *(cv2.IMWRITE_JPEG_QUALITY, 100),
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
]
# 20 and 21 are absent in 313 and 315.
NAMES_313 = tuple(f"Camera ({number})" for number in (*range(1, 20), 22, 23))
NAMES_377 = tuple(f"Camera_B{number}" for number in range(1, 24))


def write_zju(folder: Path, studio: Studio, layout: ZjuLayout = AS_RELEASED) -> Path:
    """Write a subject; the studio's cameras are named like the folders. Returns the folder."""
    numbers = studio.meshes.frame_indices + layout.first_number
    paths = {
        name: [picture_path(name, number, layout) for number in numbers.tolist()]
        for name in studio.cameras
    }
    for name in studio.cameras:
        _write_pictures(folder, paths[name], studio.frames(name), studio.masks[name], layout)
    for kind in layout.body_folders:
        (folder / kind).mkdir()
        for number, body in zip(numbers, studio.meshes.vertices, strict=True):
            np.save(folder / kind / f"{number + layout.body_number_offset}.npy", body)
    write_annotations(folder, annotations(studio, paths, layout), layout.annotations)
    return folder


def write_faces(file: Path, studio: Studio) -> Path:
    """A mesh file with the faces of the body, which stored vertices come without."""
    mesh = trimesh.Trimesh(studio.meshes.vertices[0], studio.meshes.faces, process=False)
    file.write_text(trimesh.exchange.obj.export_obj(mesh))
    return file


def annotations(studio: Studio, paths: dict[str, list[PurePosixPath]], layout: ZjuLayout) -> dict:
    """The dictionary of annots.npy: OpenCV pixels, T in millimetres (or what is asked for)."""
    cameras = list(studio.cameras.values())
    cams = {
        "K": [camera.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]) for camera in cameras],
        "D": [camera.distortion[:, None] for camera in cameras],
        "R": [camera.R for camera in cameras],
        "T": [camera.t[:, None] / layout.unit_m for camera in cameras],
    }
    if layout.nested_lists:
        cams |= {key: [value.tolist() for value in cams[key]] for key in "KDR"}
    items = []
    for row in range(len(studio.meshes.frame_indices)):
        item: dict = {"ims": [str(paths[name][row]) for name in studio.cameras]}
        if layout.keypoints:
            item["kpts2d"] = np.zeros((len(cameras), 25, 3), np.float32)
        items.append(item)
    return {"cams": cams, "ims": items}


def write_annotations(folder: Path, content: dict, name: str = "annots.npy") -> None:
    """A 0-d object array that holds a dictionary, as NumPy 1 under Python 2 (or 3) pickled it.

    An ending ``.json`` writes nested lists instead.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if name.endswith(".json"):
        text = json.dumps(content, default=lambda array: array.tolist())
        (folder / name).write_text(text)
        return
    array = np.array(content, dtype=object)
    written = pickle.dumps(array, protocol=2 if "python2" in name else 4)
    with (folder / name).open("wb") as file:
        header = np.lib.format.header_data_from_array_1_0(array)
        np.lib.format.write_array_header_1_0(file, header)
        file.write(written.replace(b"cnumpy._core.", b"cnumpy.core."))


def picture_path(name: str, number: int, layout: ZjuLayout) -> PurePosixPath:
    """``Camera_B1/000000.jpg``, or the time-stamped names of 313 and 315."""
    if not layout.time_stamped:
        return PurePosixPath(name, f"{number:06d}.jpg")
    camera = name.replace(" ", "_")
    stamp = f"2019-08-23_16-08-{50 + number / 30:.3f}"
    return PurePosixPath(name, f"CoreView_313_{camera}_{number:04d}_{stamp}.jpg")


def _write_pictures(folder, paths, frames, masks, layout: ZjuLayout) -> None:
    for path, frame, mask in zip(paths, frames, masks, strict=True):
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(file), frame[..., ::-1], _JPEG)
        for kind in layout.mask_folders:
            mask_file = folder / kind / path.with_suffix(".png")
            mask_file.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(mask_file), _labelled(mask, kind))


def _labelled(mask: np.ndarray, kind: str) -> np.ndarray:
    """Parsing labels 1 to 19 on the person, which look black; or three channels of 255."""
    if kind == "mask":
        return np.repeat(mask[..., None], 3, axis=-1).astype(np.uint8) * 255
    rows = np.arange(mask.shape[0])[:, None] % 19 + 1
    return (mask * rows).astype(np.uint8)
