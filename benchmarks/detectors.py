"""What the embedded networks make of a synthetic person of several sizes.

    python -m benchmarks.detectors

The person turns before 8 cameras; every picture is cut as for the scores (the crop around the
mask). Prints the tables of ``detectors.md``: how often the person is found and how far its points
are off, on white and before the room; what else is called a person; what a picture costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.io.pictures import as_bytes, read_picture
from mocoflow_core.metrics.crop import crop_around, crop_side
from mocoflow_core.metrics.oks import oks
from mocoflow_core.metrics.perceptual import LpipsAlex
from mocoflow_core.metrics.person_judge import PersonJudge, PersonScoreConfig, Sight
from mocoflow_core.metrics.score import WHITE, EvaluationConfig, on_white
from mocoflow_core.perception.person import Picture
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.scene_writer import write_scene

SIZES_PX = (128, 256, 512)
FRAMES = 3
REFERENCE_PX = 512  # Errors of points are written for a picture of this height.
EVALUATION = EvaluationConfig()
SCORES = PersonScoreConfig()
EVERY = np.ones(17, bool)

Damage = Callable[[Picture], Picture]


class Shot(NamedTuple):
    """One picture of the person, cut to the crop, and where its points truly are."""

    on_white: Picture
    before_room: Picture
    points: NDArray[np.float32]  # (17, 2) px of the crop
    area_px: float


def shots(folder: Path) -> Iterator[Shot]:
    """Every frame of every camera of a synthetic scene."""
    scene, truth = open_scene(folder), np.load(folder / "truth.npz")
    masks = {
        (camera, frame): read_picture(path) > 127
        for camera in scene.cameras
        for frame, path in scene.masks(camera).items()
    }
    side = crop_side(masks.values(), EVALUATION.crop_share, EVALUATION.crop_box_margin)
    for (camera, frame), mask in masks.items():
        rgb = read_picture(folder / "frames" / camera / f"{frame:06d}.png")
        crop = crop_around(mask, side)
        points = scene.cameras[camera].project(truth["keypoints3d"][frame].astype(np.float64))
        yield Shot(
            as_bytes(crop.of(on_white(rgb, mask), WHITE)),
            crop.of(rgb, WHITE * 255),
            (points - [crop.left, crop.top]).astype(np.float32),
            float(mask.sum()),
        )


def line(name: str, size_px: int, pictures: Sequence[Picture], given: Sequence[Shot]) -> str:
    """One row of the first table."""
    judge = PersonJudge(SCORES)
    start = process_time()
    sights = judge.look(pictures)
    seconds = (process_time() - start) / len(pictures)
    found = [
        (shot, sight.pose)
        for shot, sight in zip(given, sights, strict=True)
        if sight.pose is not None
    ]
    errors = [np.linalg.norm(pose.places - shot.points, axis=1) for shot, pose in found]
    alike = [oks(pose.places, shot.points, shot.area_px, EVERY) for shot, pose in found]
    return (
        f"| {name} | {size_px} | {rate(sights):.2f} "
        f"| {np.median(errors) * REFERENCE_PX / size_px:.1f} | {np.mean(alike):.3f} "
        f"| {similarity(judge, judge.look_shifted(pictures), sights, given):.3f} "
        f"| {1000 * seconds:.0f} |"
    )


def similarity(
    judge: PersonJudge, changed: Sequence[Sight], sights: Sequence[Sight], given: Sequence[Shot]
) -> float:
    """Mean OKS of changed pictures against the pictures, as in the scores."""
    found = zip(changed, sights, given, strict=True)
    return float(
        np.mean(
            [judge.similarity(a, b, shot.area_px) for a, b, shot in found if judge.has_reference(b)]
        )
    )


def rate(sights: Sequence[Sight]) -> float:
    """Share of pictures with a person."""
    return float(np.mean([sight.person for sight in sights]))


def blurred(size_px: int, at_reference_px: float) -> Damage:
    """A Gaussian blur whose sigma is given for a picture of 512 px."""
    sigma = at_reference_px * size_px / REFERENCE_PX
    return lambda picture: np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma))


def shuffled(picture: Picture) -> Picture:
    """Sixteen tiles in another order."""
    height, width = (4 * (length // 4) for length in picture.shape[:2])
    tiles = picture[:height, :width].reshape(4, height // 4, 4, width // 4, 3).swapaxes(1, 2)
    order = np.random.default_rng(0).permutation(16)
    moved = tiles.reshape(16, *tiles.shape[2:])[order].reshape(tiles.shape)
    return np.ascontiguousarray(moved.swapaxes(1, 2).reshape(height, width, 3))


def damages(size_px: int) -> dict[str, Damage]:
    """Ways to spoil a picture."""
    return {
        "clean": lambda picture: picture,
        "blur 4 px": blurred(size_px, 4),
        "blur 8 px": blurred(size_px, 8),
        "a quarter of the contrast": lambda picture: (255 - (255 - picture) // 4).astype(np.uint8),
        "shuffled tiles": shuffled,
        "upside down": lambda picture: np.ascontiguousarray(picture[::-1]),
        "white": lambda picture: np.full_like(picture, 255),
    }


def damage_line(name: str, damage: Damage, given: Sequence[Shot], lpips: LpipsAlex) -> str:
    """One row of the second table: the damaged picture as if it were a render."""
    judge = PersonJudge(SCORES)
    pictures = [shot.on_white for shot in given]
    spoiled = [damage(picture) for picture in pictures]
    references, sights = judge.look(pictures), judge.look(spoiled)
    alike = [
        judge.similarity(sight, reference, shot.area_px)
        for sight, reference, shot in zip(sights, references, given, strict=True)
        if judge.has_reference(reference)
    ]
    far = [
        lpips.distance(lpips.features(a / np.float32(255)), lpips.features(b / np.float32(255)))
        for a, b in zip(spoiled[::4], pictures[::4], strict=True)
        if a.shape == b.shape
    ]
    distance = f"{np.mean(far):.3f}" if far else "–"
    return f"| {name} | {rate(sights):.2f} | {np.mean(alike):.3f} | {distance} |"


def main() -> None:
    torch.set_num_threads(1)
    print("| behind | px | found | points off, px | OKS, truth | OKS, half a pixel | CPU ms |")
    print("|---|---|---|---|---|---|---|")
    middle: list[Shot] = []
    for size_px in SIZES_PX:
        with TemporaryDirectory() as folder:
            scene = Path(folder) / "scene"
            write_scene(SyntheticConfig(frames=FRAMES, width=size_px, height=size_px), scene)
            given = list(shots(scene))
        print(line("white", size_px, [shot.on_white for shot in given], given), flush=True)
        print(line("room", size_px, [shot.before_room for shot in given], given), flush=True)
        middle = given if size_px == SIZES_PX[1] else middle
    print("\n| picture | plausibility | OKS | LPIPS |\n|---|---|---|---|")
    lpips = LpipsAlex()
    for name, damage in damages(SIZES_PX[1]).items():
        print(damage_line(name, damage, middle, lpips), flush=True)


if __name__ == "__main__":
    main()
