"""A person made of capsules, and native scene folders that show it: exact and cheap test input."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import trimesh

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.geometry.camera import Camera

# Joints of each limb at rest, metres, z up, and the radius of its capsule.
LIMBS = {
    "torso": ([0, 0, 0.95], [0, 0, 1.4], 0.14),
    "head": ([0, 0, 1.62], [0, 0, 1.68], 0.09),
    "left_arm": ([0.18, 0, 1.4], [0.55, 0, 1.0], 0.045),
    "right_arm": ([-0.18, 0, 1.4], [-0.55, 0, 1.0], 0.045),
    "left_leg": ([0.1, 0, 0.9], [0.18, 0, 0.08], 0.07),
    "right_leg": ([-0.1, 0, 0.9], [-0.18, 0, 0.08], 0.07),
}


def look_at(eye, target, focal_px, width, height, name="cam") -> Camera:
    """A pinhole at ``eye`` that looks at ``target``, z up."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    K = np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1.0]])
    return Camera(name, width, height, K, R, -R @ np.asarray(eye, float))


def capsule_person(turns, swings, places) -> MeshSequence:
    """Bodies (T, V, 3): turned about z by ``turns``, arms swung by ``swings``, at ``places``."""
    bodies = []
    for turn, swing, place in zip(turns, swings, places, strict=True):
        parts = [_limb(name, swing) for name in LIMBS]
        body = trimesh.util.concatenate(parts)
        body.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
        bodies.append(np.asarray(body.vertices) + place)
        faces = np.asarray(body.faces, np.int32)
    indices = np.arange(len(bodies), dtype=np.int32)
    return MeshSequence(indices, np.asarray(bodies, np.float32), faces)


def walking(frames: int) -> MeshSequence:
    """A person that walks a metre while turning and swinging the arms."""
    share = np.linspace(0, 1, frames)
    places = np.stack([share - 0.5, 0.3 * np.sin(3 * share), 0 * share], axis=-1)
    return capsule_person(2 * share, 0.4 * np.sin(6 * share), places)


def _limb(name: str, swing: float) -> trimesh.Trimesh:
    start, end, radius = (np.asarray(value, float) for value in LIMBS[name])
    capsule = trimesh.creation.capsule(
        height=float(np.linalg.norm(end - start)), radius=float(radius), count=[10, 10]
    )
    capsule.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], end - start))
    capsule.apply_translation((start + end) / 2)
    if "arm" in name:
        side = 1 if "left" in name else -1
        rotation = trimesh.transformations.rotation_matrix(side * swing, [0, 1, 0], start)
        capsule.apply_transform(rotation)
    return capsule


@dataclass
class SceneRecipe:
    """What ``write_scene`` writes; tests change a field to plant a fault."""

    meshes: MeshSequence
    cameras: dict[str, Camera]
    fps: float = 12.0
    train_camera: str = "cam00"
    masks: bool = True
    background: bool = True
    coordinates: str = "world"
    located: bool = True
    description: dict = field(default_factory=dict)


def default_recipe(frames: int = 6, width: int = 64, height: int = 96) -> SceneRecipe:
    eyes = {"cam00": [0, -3.5, 1.2], "cam01": [3.5, 0, 1.2]}
    cameras = {
        name: look_at(eye, [0, 0, 0.9], 1.5 * height, width, height, name)
        for name, eye in eyes.items()
    }
    return SceneRecipe(walking(frames), cameras)


def room(width: int, height: int, seed: int = 0) -> np.ndarray:
    """A textured background, smooth enough to survive resizing."""
    noise = np.random.default_rng(seed).uniform(60, 200, (height // 4 + 1, width // 4 + 1, 3))
    return (
        cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
        .clip(0, 255)
        .astype(np.uint8)
    )


def write_scene(folder: Path, recipe: SceneRecipe) -> Path:
    """Write the native scene folder and return it."""
    cameras = {}
    for seed, (name, camera) in enumerate(recipe.cameras.items()):
        plate = room(camera.width, camera.height, seed)
        masks = silhouettes(recipe.meshes.vertices, recipe.meshes.faces, camera)
        for kind in ("frames", "masks"):
            (folder / kind / name).mkdir(parents=True)
        for index, mask in zip(recipe.meshes.frame_indices, masks, strict=True):
            frame = np.where(mask[..., None], np.uint8([230, 30, 40]), plate)
            cv2.imwrite(str(folder / "frames" / name / f"{index:06d}.png"), frame[..., ::-1])
            white = mask.astype(np.uint8) * 255
            cv2.imwrite(str(folder / "masks" / name / f"{index:06d}.png"), white)
        cameras[name] = {**camera.to_json(), "frames": f"frames/{name}"}
        if recipe.masks:
            cameras[name]["masks"] = f"masks/{name}"
        if recipe.background:
            (folder / "background").mkdir(exist_ok=True)
            cv2.imwrite(str(folder / "background" / f"{name}.png"), plate[..., ::-1])
            cameras[name]["background"] = f"background/{name}.png"
    recipe.meshes.save(folder / "meshes.npz")
    description = {
        "format": "mocoflow-scene",
        "version": 1,
        "name": "capsules",
        "fps": recipe.fps,
        "world": {"unit": "m", "up": "+z"},
        "train_camera": recipe.train_camera,
        "cameras": cameras,
        "meshes": {
            "file": "meshes.npz",
            "coordinates": recipe.coordinates,
            "located": recipe.located,
        },
    }
    (folder / "scene.json").write_text(json.dumps(description | recipe.description))
    return folder


def edit_description(folder: Path, change) -> None:
    """Apply ``change`` to the parsed scene.json."""
    file = folder / "scene.json"
    description = json.loads(file.read_text())
    change(description)
    file.write_text(json.dumps(description))
