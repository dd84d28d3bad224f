"""Where BlazePose sees landmarks, relative to Anny's joints: measured on renders of Anny.

``python benchmarks/landmark_offsets.py`` prints the table of
``mocoflow_core/body/fit/landmark_offsets.py``; some minutes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fittable_body import LANDMARKS, FittableBody
from mocoflow_core.body.fit.landmark_misfit import project
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.geometry.nearest_rotation import rotation_by_svd
from mocoflow_core.perception.blazepose import PRESENT, BlazePose
from mocoflow_core.perception.person import BodyLandmarks
from mocoflow_core.synthetic.background import render_background
from mocoflow_core.synthetic.body_shape import BodyShape
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.mesh_estimate import COARSE_TOPOLOGY
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.renderer import FrameRenderer
from mocoflow_core.synthetic.scene_writer import perform
from mocoflow_core.synthetic.topology import coarse_topology

Array = NDArray[np.float64]

FRAMES, CAMERAS, SIZE = 6, 6, 384
USUAL_ERROR_M = 0.02
ROUNDS = 20
PEOPLE = (
    ("turn", "tight", BodyShape(height=0.38)),
    ("walk_circle", "loose", BodyShape(gender=1.0, height=0.37)),
    ("dance", "tight", BodyShape(gender=1.0, height=0.42, weight=0.65)),
    ("still", "loose", BodyShape(height=0.33, weight=0.65, muscle=0.6)),
)


@dataclass(frozen=True, eq=False)
class Look:
    """One picture: in the camera's axes, what BlazePose saw and what there was."""

    sightings: Sightings
    points: Array  # (21, 3) Anny's landmarks
    turns: Array  # (21, 3, 3) of the part of each landmark
    slopes: Array  # (21, 2, 3) pixels for each metre
    off: Array  # (21, 2) pixels from the landmark to where it was seen
    metres: Array  # (21,) worth of a pixel


def looks(body: FittableBody) -> Iterator[Look]:
    """Pictures of all people, motions and directions in which somebody is found."""
    detector = BlazePose()
    for motion, clothing, shape in PEOPLE:
        configuration = SyntheticConfig(
            motion=motion, clothing=clothing, shape=shape, frames=FRAMES, cameras=CAMERAS,
            width=SIZE, height=SIZE, supersampling=2,
        )  # fmt: skip
        person = Person.load(shape)
        posed, performance = perform(configuration, person)
        coarse = coarse_topology(person, COARSE_TOPOLOGY).vertices(person.pose(posed))
        cameras = camera_ring(configuration, performance.vertices)
        rooms = [render_background(camera, 2, 0) for camera in cameras]
        for vertices, skin in zip(coarse, performance.vertices, strict=True):
            frame = FrameRenderer(performance.surface, skin, "none")
            for camera, room in zip(cameras, rooms, strict=True):
                picture = frame.render(camera, room, 2)
                rows, columns = np.nonzero(picture.mask)
                box = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
                found = detector.poses([picture.rgb], [box.astype(np.float64)])[0]
                if found.presence >= PRESENT:
                    yield look(body, camera.to_camera(vertices), camera.K, found.landmarks)


def look(body: FittableBody, vertices: Array, K: Array, landmarks: BodyLandmarks) -> Look:
    sightings = Sightings.of(
        landmarks.places[None], landmarks.visibility[None], landmarks.world[None]
    )
    points = body.regressor @ vertices
    pixels, slopes = project(points, K)
    turns = part_turns(body, vertices)[part_of_landmarks(body)]
    metres = points[:, 2] / K[0, 0]
    return Look(sightings, points, turns, slopes, sightings.places[0] - pixels, metres)


def part_of_landmarks(body: FittableBody) -> NDArray[np.int64]:
    return np.asarray((body.regressor @ body.weights).argmax(1))


def part_turns(body: FittableBody, vertices: Array) -> Array:
    """(J, 3, 3) how each part is turned from the rest pose (Kabsch)."""
    turns = []
    for weights in body.weights.T:
        share = (weights**2 / (weights**2).sum())[:, None]
        ours = body.vertices - (share * body.vertices).sum(0)
        theirs = vertices - (share * vertices).sum(0)
        turns.append(rotation_by_svd((share * theirs).T @ ours))
    return np.stack(turns)


def offsets(seen: list[Look]) -> Array:
    """(21, 3) metres in each part's rest axes, the same on both sides (robust least squares)."""
    result = np.zeros((len(LANDMARKS), 3))
    done = set()
    for row, name in enumerate(LANDMARKS):
        other = name.replace("left_", "right_")
        twin = LANDMARKS.index(other)
        if row in done:
            continue
        done |= {row, twin}
        sides = [(row, np.ones(3))]
        sides += [(twin, np.array([-1.0, 1.0, 1.0]))] if twin != row else []
        if twin == row:
            sides.append((row, np.array([-1.0, 1.0, 1.0])))  # The middle has no side.
        matrices = np.stack(
            [s.metres[r] * s.slopes[r] @ s.turns[r] * m for s in seen for r, m in sides]
        )
        off = np.stack([s.metres[r] * s.off[r] for s in seen for r, _ in sides])
        trust = np.array([s.sightings.confidence[0, r] for s in seen for r, _ in sides])
        found = np.zeros(3)
        for _ in range(ROUNDS):
            left = off - matrices @ found
            weight = trust / (1 + (left**2).sum(1) / USUAL_ERROR_M**2)
            turned = np.swapaxes(matrices, 1, 2) * weight[:, None, None]
            found = np.linalg.solve(
                (turned @ matrices).sum(0) + 1e-6 * np.eye(3),
                (turned @ off[..., None]).sum(0)[:, 0],
            )
        for r, m in sides[:2] if twin != row else sides[:1]:
            result[r] = m * found
    return result


def errors(seen: list[Look], table: Array) -> str:
    """Median distances in mm, in the picture and in space (from the middle of the hips)."""
    hips = [LANDMARKS.index("left_hip"), LANDMARKS.index("right_hip")]
    picture, space = [], []
    for s in seen:
        assert s.sightings.world is not None  # BlazePose always gives them.
        moved = (s.turns @ table[:, :, None])[..., 0]
        left = s.off - (s.slopes @ moved[..., None])[..., 0]
        picture.append(1e3 * s.metres * np.linalg.norm(left, axis=1))
        points = s.points + moved
        world = s.sightings.world[0]
        off = (points - points[hips].mean(0)) - (world - world[hips].mean(0))
        space.append(1e3 * np.linalg.norm(off, axis=1))
    return f"picture {np.median(picture, 0).round()}, space {np.median(space, 0).round()} mm"


def main() -> None:
    body = FittableBody.load()
    seen = list(looks(body))
    print(f"{len(seen)} of {len(PEOPLE) * FRAMES * CAMERAS} pictures with a person")
    table = offsets(seen)
    print("as Anny's:", errors(seen, 0 * table))
    print("calibrated:", errors(seen, table))
    for name, row in zip(LANDMARKS, table, strict=True):
        print(f'    "{name}": ({row[0]:.3f}, {row[1]:.3f}, {row[2]:.3f}),')


if __name__ == "__main__":
    main()
