"""The person cut out of the frames and set before the plate or before white: no cast shadow stays.

MoCo-Flow sec. 4, data: white behind the person for People-Snapshot; for AIST, the segmented person
on the median background, which removes moving shadows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import Scene
from mocoflow_core.capture.strange_frames import listed
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.capture.working_pictures import source_mask

BehindPerson = Literal["kept", "plate", "white"]
WHITE = 255


def composite_clip(
    scene: Scene, clip: Clip, behind: BehindPerson, mask_files: dict[int, Path]
) -> Clip:
    """The clip with what is behind the person replaced, in its frames and as its background.

    The mask cuts hard, at the size of the files, before pictures shrink: pixels inside stay as
    they are, those outside become the new background exactly, and working pixels on the edge mix
    the two by area. A feathered edge would bring back what was behind the person, and the shadow
    at the feet is darkest there.

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
    cut = _cut_by_files(scene, clip, mask_files) if mask_files else _cut_by_masks(clip)
    for row, (person, coverage) in enumerate(cut):
        if clip.has_mask[row]:
            rest = (1 - coverage[..., None] / 255) * background
            frames[row] = np.clip(np.rint(person + rest), 0, 255)
    return replace(clip, frames=frames, background=background, remarks=clip.remarks + unknown)


def _with_known_masks(clip: Clip, behind: BehindPerson) -> tuple[Clip, tuple[str, ...]]:
    """The clip without the frames that cannot be composited, and words about them."""
    if clip.has_mask.all():
        return clip, ()
    named = listed(clip.frame_indices[~clip.has_mask].tolist())
    if behind == "plate":
        return clip, (f"{named} without a mask kept as seen: shadows stay there",)
    return clip.at_rows(clip.has_mask), (f"{named} left out: no mask says what is not white",)


def _cut_by_masks(clip: Clip) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    for frame, mask in zip(clip.frames, clip.masks, strict=True):
        coverage = np.where(mask, np.uint8(255), np.uint8(0))
        yield np.where(mask[..., None], frame, np.uint8(0)), coverage


def _cut_by_files(
    scene: Scene, clip: Clip, files: dict[int, Path]
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    """The person on black (H, W, 3) and its coverage (H, W) of 0 to 255, at the working size."""
    name = clip.camera.name
    view = WorkingView(scene.cameras[name], clip.camera)
    for number, picture in scene.frames(name).read(clip.frame_indices.tolist()):
        inside = source_mask(files[number], view) > 127
        person = np.where(inside[..., None], picture, np.uint8(0))
        yield view.image(person), view.image(np.where(inside, np.uint8(255), np.uint8(0)))
