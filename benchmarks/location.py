"""How well the location search finds bodies whose place is known, beside the closed form.

``python -m benchmarks.location [--scenes turn walk dance] [--frames 36]`` prints a table in
Markdown: scene, estimate and trouble with the masks -> lateral and depth error, median and 95 %.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.location import locate_body
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.catalogue import named_scene
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.mesh_estimate import estimate_meshes
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.recording import root_centred
from mocoflow_core.synthetic.scene_writer import perform

Array = NDArray[np.float64]
Masks = NDArray[np.bool_]

ESTIMATES = {"exact": "", "6 degrees": "_noise6", "other person": "_other_shape"}
WRONG_SHARE = 0.15  # of the masks, where some are wrong
CUT_SHARE = 1 / 3  # of the clip, where the border cuts the person
CUT = 0.35  # of the person then lies beyond the border
LEAVING_SHARE = 0.2  # of the clip, while the person moves there


@dataclass(frozen=True, eq=False)
class KnownPlace:
    """Root-centred bodies, the masks of the person they were estimated from, and the truth."""

    clip: Clip
    bodies: MeshSequence  # the train camera's axes, root at the origin
    roots: Array  # (T, 3) metres, the train camera's axes


def known_place(configuration: SyntheticConfig, towards: Array | None = None) -> KnownPlace:
    """A synthetic performance as cam00 sees it.

    ``towards`` (2,) x, y of the image: in the last third of the clip the person is moved that way
    until about ``CUT`` of it lies beyond the border.
    """
    person = Person.load(configuration.shape)
    motion, performance = perform(configuration, person)
    camera = camera_ring(configuration, performance.vertices)[0]
    bodies = root_centred(
        estimate_meshes(configuration, person, motion), camera, performance.root_position
    )
    seen = camera.to_camera(performance.vertices)
    away = np.zeros((configuration.frames, 3))
    if towards is not None:
        away[:, :2] = _leaving(camera, seen, towards)
    vertices = camera.to_world(seen + away[:, None])
    masks = silhouettes(vertices, performance.surface.faces, camera)
    roots = camera.to_camera(performance.root_position) + away
    return KnownPlace(_clip(camera, masks, configuration.fps), bodies, roots)


def _leaving(camera: Camera, seen: Array, towards: Array) -> Array:
    """Metres (T, 2) to the side that move bodies (T, V, 3) smoothly beyond the border."""
    beyond = np.quantile(seen[..., :2] @ towards, 1 - CUT, axis=1)
    depth = seen[..., 2].mean(axis=1)
    border = np.abs(towards) @ ([camera.width, camera.height] / (2 * np.diag(camera.K)[:2]))
    time = np.arange(len(seen)) / (len(seen) - 1)
    share = np.clip((time - (1 - CUT_SHARE)) / LEAVING_SHARE + 0.5, 0, 1)
    smooth = share**2 * (3 - 2 * share)
    return ((border * depth - beyond) * smooth)[:, None] * towards


def _clip(camera: Camera, masks: Masks, fps: float) -> Clip:
    count = len(masks)
    return Clip(
        camera,
        fps,
        np.arange(count, dtype=np.int32),
        np.zeros((count, 1, 1, 3), np.uint8),
        masks,
        np.ones(count, bool),
        np.zeros(count, bool),
        np.zeros((1, 1, 3), np.uint8),
    )


def with_wrong_masks(masks: Masks, share: float, seed: int = 0) -> Masks:
    """Some masks empty, half, of something else, or inverted, in turn."""
    random = np.random.default_rng(seed)
    wrong = masks.copy()
    chosen = random.permutation(len(masks))[: round(share * len(masks))]
    for number, row in enumerate(chosen):
        wrong[row] = _wrong(masks[row], number % 4)
    return wrong


def _wrong(mask: NDArray[np.bool_], kind: int) -> NDArray[np.bool_]:
    height, width = mask.shape
    rows = np.flatnonzero(mask.any(axis=1))
    if kind == 0:
        return np.zeros_like(mask)
    if kind == 1:
        upper = mask.copy()
        upper[(rows[0] + rows[-1]) // 2 :] = False
        return upper
    if kind == 2:
        blob = np.zeros_like(mask)
        blob[height // 8 : height // 3, width // 12 : width // 3] = True
        return blob
    return ~mask


@cache
def _scenes(name: str, estimate: str, frames: int) -> dict[str, KnownPlace]:
    configuration = named_scene(f"{name}{ESTIMATES[estimate]},frames={frames}")
    places = {
        "": known_place(configuration),
        "cut at the side": known_place(configuration, np.array([1.0, 0.0])),
        "cut below": known_place(configuration, np.array([0.0, 1.0])),
    }
    whole = places[""]
    wrong = with_wrong_masks(whole.clip.masks, WRONG_SHARE)
    places["15 % wrong"] = replace(whole, clip=replace(whole.clip, masks=wrong))
    return places


def closed_form(place: KnownPlace) -> Array:
    """What a weak perspective camera says: ``(tx, ty, 2f / (s W))`` (T, 3), from the mask's box.

    Its scale and shift give the body's box the height and the centre of the mask's box.
    """
    K, found = place.clip.camera.K, np.full_like(place.roots, np.nan)
    for row, (mask, body) in enumerate(
        zip(place.clip.masks, place.bodies.vertices.astype(float), strict=True)
    ):
        if not mask.any():
            continue
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        low, high = body[:, :2].min(axis=0), body[:, :2].max(axis=0)
        depth = K[1, 1] * (high - low)[1] / (rows[-1] + 1 - rows[0])
        middle = np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1]) / 2
        lateral = (middle - K[:2, 2]) * depth / K[[0, 1], [0, 1]]
        found[row] = [*(lateral - (low + high) / 2), depth]
    return found


def search(place: KnownPlace, first: Array | None = None) -> Array:
    """What the location search finds (T, 3)."""
    ingested = IngestedMeshes(place.bodies, "camera-root-centred", False, (), first)
    return locate_body(place.clip, ingested, LocationConfig()).translations


METHODS: dict[str, Callable[[KnownPlace], Array]] = {
    "search": search,
    "search from the closed form": lambda place: search(place, closed_form(place)),
    "closed form": closed_form,
}


def _row(place: KnownPlace, method: str) -> str:
    start = time.process_time()
    error = METHODS[method](place) - place.roots
    cpu_s = (time.process_time() - start) / len(error)
    known = np.isfinite(error).all(axis=1)
    lateral, depth = np.linalg.norm(error[known, :2], axis=1), np.abs(error[known, 2])
    cells = [
        f"{100 * np.percentile(values, share):.1f}"
        for values in (lateral, depth)
        for share in (50, 95)
    ]
    return " | ".join([*cells, f"{cpu_s:.2f}"])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["turn", "walk", "dance"])
    parser.add_argument("--estimates", nargs="+", default=["exact", "6 degrees"])
    parser.add_argument("--frames", type=int, default=36)
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    chosen = parser.parse_args()
    print(
        "| scene | estimate | masks | method | lateral, median | 95 % | depth, median | 95 % | s |"
    )
    print("|---|---|---|---|--:|--:|--:|--:|--:|")
    for name in chosen.scenes:
        for estimate in chosen.estimates:
            for trouble, place in _scenes(name, estimate, chosen.frames).items():
                for method in chosen.methods:
                    row = _row(place, method)
                    print(f"| {name} | {estimate} | {trouble} | {method} | {row} |", flush=True)


if __name__ == "__main__":
    main()
