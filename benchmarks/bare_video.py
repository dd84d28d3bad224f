"""What is found in a bare video, against what is known of a recorded scene's camera.

    python benchmarks/bare_video.py SCENE cam02

The camera's video alone is read; its masks and the truth's keypoints serve the comparison.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.datasets.bare_video import usable_frames
from mocoflow_core.io.pictures import read_picture
from mocoflow_core.io.video_facts import read_video_facts
from mocoflow_core.perception.blazepose import BlazePose
from mocoflow_core.video.camera_check import require_still_camera
from mocoflow_core.video.clip_frames import ClipFrames, choose_frames
from mocoflow_core.video.configuration import VideoConfig
from mocoflow_core.video.followed_person import FollowedPerson, follow_person
from mocoflow_core.video.person_masks import PackedMasks, make_plate, mask_person


def silent(fraction: float, text: str) -> None:
    """No progress is shown."""


def mask_overlaps(
    scene: Scene, camera: str, masks: PackedMasks, person: FollowedPerson, frames: ClipFrames
) -> dict[str, NDArray[np.float64]]:
    """Intersection over union with the given masks, of ours and of the network's alone."""
    overlaps: dict[str, list[float]] = {"final": [], "network alone": []}
    given = scene.masks(camera)
    height, width = masks.shape
    for row, number in enumerate(frames.numbers.tolist()):
        if number not in given:
            continue
        picture = read_picture(given[number])
        truth = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA) > 127
        alone = person.poses[row].mask(height, width) > 0.5
        for name, mask in (("final", masks.at(row)), ("network alone", alone)):
            overlaps[name].append((mask & truth).sum() / (mask | truth).sum())
    return {name: np.array(values) for name, values in overlaps.items()}


def keypoint_distances(
    scene: Scene, camera: str, person: FollowedPerson, frames: ClipFrames
) -> NDArray[np.float64]:
    """(T, 17) pixels of the video, against the truth's keypoints seen by the calibrated camera."""
    truth = np.load(scene.truth() or "no truth")
    known = scene.cameras[camera].undistorted().project(truth["keypoints3d"].astype(np.float64))
    scale = frames.video_size[0] / frames.size[0]
    rows = np.searchsorted(truth["frame_indices"], frames.numbers)
    found = np.stack([pose.keypoints.places for pose in person.poses]) * scale
    return np.linalg.norm(found - known[rows], axis=-1)


def main() -> None:
    scene, camera = open_scene(Path(sys.argv[1])), sys.argv[2]
    video = scene.root / scene.description.cameras[camera].frames
    configuration = VideoConfig(fps=1000.0)
    begun = time.process_time()
    facts = read_video_facts(video)
    frames, said = choose_frames(video, facts, configuration)
    person = follow_person(frames, frames.rate, 0.0, None, BlazePose(), silent)
    frames = frames.part(person.first, person.last)
    followed = time.process_time()
    usable = usable_frames(frames, scene.description.working_fps)
    plate, pictures, covered = make_plate(
        frames, person, usable, frames.size, configuration.plate_frames
    )
    _, motion = require_still_camera(pictures[::4], covered[::4])
    plated = time.process_time()
    masks = mask_person(
        frames, frames.rate, person, usable, plate, configuration.least_difference, silent
    )
    masked = time.process_time()
    print(said, person.remarks, motion, sep="\n")
    count = len(person.poses)
    print(
        f"CPU seconds: {(followed - begun) / count:.2f} a frame to follow the person, "
        f"{plated - followed:.1f} for the plate, {(masked - plated) / count:.2f} a frame for masks"
    )
    for name, values in mask_overlaps(scene, camera, masks, person, frames).items():
        print(
            f"mask IoU, {name}: median {np.median(values):.3f}, 5 % {np.quantile(values, 0.05):.3f}"
        )
    apart = keypoint_distances(scene, camera, person, frames)
    print(
        f"keypoints: median {np.nanmedian(apart):.1f} px, 95 % {np.nanquantile(apart, 0.95):.1f} px"
    )


if __name__ == "__main__":
    main()
