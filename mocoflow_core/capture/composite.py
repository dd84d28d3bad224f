"""The person cut out of the frames and set before the plate or before white: no cast shadow stays.

MoCo-Flow sec. 4, data: white behind the person for People-Snapshot; for AIST, the segmented person
on the median background, which removes moving shadows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.scene_description import BehindPerson
from mocoflow_core.capture.strange_frames import listed
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.capture.working_pictures import source_mask
from mocoflow_core.progress import Progress, untold

Picture = NDArray[np.uint8]
WHITE = 255
# Without it a person of 96 pixels was learned 0.2 dB worse.
RIM_PX = 1


def composite_clip(
    scene: Scene,
    clip: Clip,
    behind: BehindPerson,
    mask_files: dict[int, Path],
    progress: Progress = untold,
) -> Clip:
    """The clip with what is behind the person replaced, in its frames and as its background.

    The mask cuts hard, at the size of the files, before pictures shrink: pixels inside stay as
    they are, those outside become the new background exactly, and working pixels on the edge mix
    the two by area. Before the plate the cut is ``RIM_PX`` wider: those pixels show up to half of
    the person, on what the plate shows too. Before white they would show what was behind.

    A frame whose mask is unknown stays as it is before the plate and is left out before white.

    Args:
        mask_files: by source number; empty where the clip's masks come from no file.

    Raises InputError for files of another size than their camera's.
    """
    if behind == "kept":
        return clip
    clip, unknown = _with_known_masks(clip, behind)
    background = clip.background
    if behind == "white":
        background = np.full_like(background, WHITE)
    frames = np.array(clip.frames)
    rim_px = RIM_PX if behind == "plate" else 0
    if mask_files:
        cut = _cut_by_files(scene, clip, mask_files, rim_px)
    else:
        cut = _cut_by_masks(clip, rim_px)
    for row, (person, coverage) in enumerate(cut):
        if clip.has_mask[row]:
            rest = (1 - coverage[..., None] / 255) * background
            frames[row] = np.clip(np.rint(person + rest), 0, 255)
        progress((row + 1) / len(frames), f"frame {clip.frame_indices[row]} cut out")
    return replace(clip, frames=frames, background=background, remarks=clip.remarks + unknown)


def _with_known_masks(clip: Clip, behind: BehindPerson) -> tuple[Clip, tuple[str, ...]]:
    """The clip without the frames that cannot be composited, and words about them."""
    if clip.has_mask.all():
        return clip, ()
    named = listed(clip.frame_indices[~clip.has_mask].tolist())
    if behind == "plate":
        return clip, (f"{named} without a mask kept as seen: shadows stay there",)
    return clip.at_rows(clip.has_mask), (f"{named} left out: no mask says what is not white",)


def _cut_by_masks(clip: Clip, rim_px: int) -> Iterator[tuple[Picture, Picture]]:
    """The person on black (H, W, 3) and its coverage (H, W) of 0 to 255, at the working size."""
    for frame, mask in zip(clip.frames, clip.masks, strict=True):
        yield _cut(np.asarray(frame), np.asarray(mask), rim_px)


def _cut_by_files(
    scene: Scene, clip: Clip, files: dict[int, Path], rim_px: int
) -> Iterator[tuple[Picture, Picture]]:
    """The same, cut at the size of the files."""
    name = clip.camera.name
    view = WorkingView(scene.cameras[name], clip.camera)
    for number, picture in scene.frames(name).read(clip.frame_indices.tolist()):
        person, coverage = _cut(picture, source_mask(files[number], view) > 127, rim_px)
        yield view.image(person), view.image(coverage)


def _cut(picture: Picture, mask: NDArray[np.bool_], rim_px: int) -> tuple[Picture, Picture]:
    side = 2 * rim_px + 1
    inside = cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    person = np.where(inside[..., None], picture, np.uint8(0))
    return person, np.where(inside, np.uint8(255), np.uint8(0))
