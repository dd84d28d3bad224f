"""How well a body is fitted to one camera's landmarks and masks: against made and measured truth.

``python benchmarks/body_fit.py [BALANCE]`` prints the tables of ``body_fit.md``; BALANCE is the
folder of the four-camera recording, without it the made scenes alone are fitted.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fit_body import BodyFitConfig, fit_body
from mocoflow_core.body.fit.fittable_body import FittableBody
from mocoflow_core.body.fit.landmark_offsets import BLAZEPOSE_OFFSETS
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.frame_source import read_mask
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.nearest_rotation import rotation_by_svd
from mocoflow_core.metrics.keypoints import regress_keypoints
from mocoflow_core.perception.blazepose import BlazePose
from mocoflow_core.synthetic.background import render_background
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.recording import Performance
from mocoflow_core.synthetic.renderer import FrameRenderer
from mocoflow_core.synthetic.scene_writer import perform

Array = NDArray[np.float64]

SCENES = ("turn", "walk", "dance", "dance_loose")
NOISE_PX = (0, 3, 6)
SIZE = 512
HIPS = [11, 12]


@dataclass(frozen=True, eq=False)
class Filmed:
    """One camera's view of a person whose keypoints are known."""

    name: str
    camera: Camera
    fps: float
    masks: NDArray[np.bool_]
    keypoints: Array  # (T, 17, 3) world metres
    stature_m: float


def aligned(points: Array, truth: Array) -> Array:
    """Points (K, 3) turned, moved and scaled onto the truth (Procrustes)."""
    ours, theirs = points - points.mean(0), truth - truth.mean(0)
    turned = ours @ rotation_by_svd(theirs.T @ ours).T
    return turned * (turned * theirs).sum() / (turned**2).sum() + truth.mean(0)


def row(name: str, found: Array, truth: Array, overlaps: Array, rest: tuple[str, str]) -> str:
    """A line of the table: mean distances of keypoints (T, 17, 3) in mm, then the rest."""
    from_hips = [k - k[:, HIPS].mean(1, keepdims=True) for k in (found, truth)]
    alike = np.stack([aligned(ours, theirs) for ours, theirs in zip(found, truth, strict=True)])
    distances = [
        1e3 * np.linalg.norm(a - b, axis=-1).mean()
        for a, b in ((found, truth), from_hips, (alike, truth))
    ]
    known = overlaps[np.isfinite(overlaps)]
    cells = [f"{value:.0f}" for value in distances]
    return (
        f"| {name} | "
        + " | ".join([*cells, f"{known.mean():.3f}" if len(known) else "", *rest])
        + " |"
    )


def fit(
    name: str,
    filmed: Filmed,
    sightings: Sightings,
    configuration: BodyFitConfig,
    with_masks: bool = True,
) -> None:
    start = time.process_time()
    masks = filmed.masks if with_masks else None
    fitted = fit_body(sightings, masks, filmed.camera, filmed.fps, configuration)
    cpu_s = (time.process_time() - start) / len(filmed.keypoints)
    found = regress_keypoints(FittableBody.load().regressor[:17], fitted.meshes.vertices)
    rest = (f"{fitted.readings['stature_m']:.2f}", f"{cpu_s:.3f}")
    print(row(name, found, filmed.keypoints, fitted.silhouette_iou, rest), flush=True)


def fit_held_out(name: str) -> None:
    """At 30 frames a second, with the frames half-way between working ones looked at and not."""
    filmed = performed(f"{name},fps=30,frames=120")
    half_way = np.arange(len(filmed.keypoints)) % 3 == 1
    known, sightings = BodyFitConfig(height_m=filmed.stature_m), exact(filmed, 3)
    for title, usable in (("all looked at", None), ("a third held out", ~half_way)):
        fitted = fit_body(sightings, filmed.masks, filmed.camera, filmed.fps, known, usable=usable)
        vertices = fitted.meshes.vertices.astype(np.float64)
        found = regress_keypoints(FittableBody.load().regressor[:17], vertices)
        covered = overlap(silhouettes(vertices, fitted.meshes.faces, filmed.camera), filmed.masks)
        for part, rows in (("others", ~half_way), ("half-way", half_way)):
            named = f"{name}, 30 a second, {title}: {part}"
            line = row(named, found[rows], filmed.keypoints[rows], covered[rows], ("", ""))
            print(line, flush=True)


def supplied(filmed: Filmed, vertices: Array, faces: NDArray[np.int32]) -> None:
    """The mesh that came with the recording, world metres, of the same topology."""
    found = regress_keypoints(FittableBody.load().regressor[:17], vertices)
    overlaps = overlap(silhouettes(vertices, faces, filmed.camera), filmed.masks)
    print(row("the mesh supplied", found, filmed.keypoints, overlaps, ("", "")), flush=True)


def performed(name: str) -> Filmed:
    """A made scene without pictures."""
    return _filmed(name)[0]


def made(name: str) -> tuple[Filmed, Sightings]:
    """A made scene, and what BlazePose sees of its pictures."""
    filmed, performance, seed = _filmed(name)
    room = render_background(filmed.camera, 1, seed)
    pictures = (
        FrameRenderer(performance.surface, vertices, "none").render(filmed.camera, room, 2).rgb
        for vertices in performance.vertices
    )
    return filmed, blazepose(pictures, filmed.masks)


def _filmed(name: str) -> tuple[Filmed, Performance, int]:
    configuration = named_scene(f"{name},width={SIZE},height={SIZE}")
    person = Person.load(configuration.shape)
    _, performance = perform(configuration, person)
    camera = camera_ring(configuration, performance.vertices)[0]
    masks = silhouettes(performance.vertices, performance.surface.faces, camera)
    stature = float(np.ptp(person.rest_vertices[np.unique(person.outer_faces)][:, 2]))
    filmed = Filmed(name, camera, configuration.fps, masks, performance.keypoints3d, stature)
    return filmed, performance, configuration.seed


def blazepose(pictures: Iterator[NDArray[np.uint8]], masks: NDArray[np.bool_]) -> Sightings:
    """The person of each mask as BlazePose sees it."""
    detector, found = BlazePose(), []
    for picture, mask in zip(pictures, masks, strict=False):
        rows, columns = np.nonzero(mask)
        box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        found.append(detector.poses([picture], [np.array(box, np.float64)])[0].landmarks)
    return Sightings.of(
        np.stack([person.places for person in found]),
        np.stack([person.visibility for person in found]),
        np.stack([person.world for person in found]),
    )


def exact(filmed: Filmed, noise_px: float) -> Sightings:
    """The true keypoints in the picture, each off by so much along either axis (rms)."""
    places = filmed.camera.project(filmed.keypoints)
    noise = noise_px * np.random.default_rng(1).standard_normal(places.shape)
    return Sightings.of(places + noise, np.ones(places.shape[:2]))


def fit_made(name: str) -> None:
    filmed, seen = made(name)
    plain, known = BodyFitConfig(), BodyFitConfig(height_m=filmed.stature_m)
    for noise in NOISE_PX:
        sightings = exact(filmed, noise)
        fit(f"{name}, {noise} px, landmarks alone", filmed, sightings, plain, False)
        fit(f"{name}, {noise} px", filmed, sightings, plain)
        fit(f"{name}, {noise} px, height given", filmed, sightings, known)
    fit(f"{name}, BlazePose", filmed, seen, plain)
    fit(f"{name}, BlazePose, height given", filmed, seen, known)


def fit_balance(folder: Path) -> None:
    scene = open_scene(folder)
    camera = scene.cameras[scene.train_camera].undistorted()
    frames = scene.frames(scene.train_camera)
    masks = scene.masks(scene.train_camera)
    numbers = [int(index) for index in frames.indices]
    shown = np.stack([read_mask(masks[number]) > 127 for number in numbers])
    with np.load(folder / "truth.npz") as truth:
        keypoints = truth["keypoints3d"].astype(np.float64)
    filmed = Filmed("balance", camera, scene.description.fps, shown, keypoints, 1.70)
    with np.load(folder / "meshes.npz") as given:
        supplied(filmed, camera.to_world(given["vertices"].astype(np.float64)), given["faces"])
    places = camera.project(keypoints)
    reprojected = Sightings.of(places, np.ones(places.shape[:2]))
    calibrated = replace(reprojected, offsets=BLAZEPOSE_OFFSETS)
    fit("truth seen in cam02", filmed, calibrated, BodyFitConfig())
    fit("truth seen in cam02, 1.70 m", filmed, calibrated, BodyFitConfig(height_m=1.70))
    seen = blazepose((picture for _, picture in frames.read(numbers)), shown)
    fit("BlazePose, landmarks alone", filmed, seen, BodyFitConfig(), False)
    fit("BlazePose", filmed, seen, BodyFitConfig())
    fit("BlazePose, 1.70 m", filmed, seen, BodyFitConfig(height_m=1.70))
    fit("BlazePose, no offsets", filmed, replace(seen, offsets=None), BodyFitConfig())
    fit("BlazePose, nothing in space", filmed, replace(seen, world=None), BodyFitConfig())


if __name__ == "__main__":
    print("| | raw mm | hips mm | Procrustes mm | IoU | stature m | CPU s a frame |")
    print("|---|---|---|---|---|---|---|")
    if len(sys.argv) > 1:
        fit_balance(Path(sys.argv[1]))
    for scene_name in SCENES:
        fit_made(scene_name)
    for scene_name in ("walk", "dance"):
        fit_held_out(scene_name)
