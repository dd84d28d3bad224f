"""Findings about a capture that a user should see, each with its measured value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mocoflow_core.capture.background_motion import background_motion_px
from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera

# dataset-formats: outside these a mask is inverted, empty, or of something else.
FOREGROUND_SHARE = (0.01, 0.6)
# The method assumes a camera that stands still.
LARGEST_BACKGROUND_MOTION_PX = 0.5
# Lenses of video cameras see between these, in degrees across the longer side.
FIELD_OF_VIEW_DEG = (5.0, 130.0)
# Pixels of cameras are square to about this.
SQUARE_PIXELS = 0.05
# 59.94 and 60 are the same rate.
RATE_TOLERANCE = 0.02


@dataclass(frozen=True)
class CaptureFindings:
    """What was measured on a few frames."""

    foreground_share: float  # median over frames
    empty_masks: int
    background_motion_px: float  # of source pixels; nan where nothing could be seen
    warnings: tuple[str, ...]


def check_capture(clip: Clip, source: Camera) -> CaptureFindings:
    """Masks of a usual size, a camera that stands still, a principal point inside the image."""
    shares = clip.masks.mean(axis=(1, 2))
    share = float(np.median(shares))
    motion_px = background_motion_px(clip.frames, clip.masks) * source.width / clip.camera.width
    empty = int((shares == 0).sum())
    warnings = [*check_lens(source), *check_share(share)]
    if empty:
        warnings.append(f"{empty} of {len(shares)} looked-at masks are empty")
    if motion_px > LARGEST_BACKGROUND_MOTION_PX:
        warnings.append(
            f"the background moves by {motion_px:.2f} px "
            f"(limit {LARGEST_BACKGROUND_MOTION_PX} px): does the camera stand still?"
        )
    return CaptureFindings(share, empty, motion_px, tuple(warnings))


def check_lens(camera: Camera) -> tuple[str, ...]:
    """Whether K is that of a usual lens, for pictures of this size."""
    return (*_principal_point(camera), *_focal_length(camera))


def check_share(share: float) -> tuple[str, ...]:
    """Whether masks cover a usual share of the image."""
    if FOREGROUND_SHARE[0] <= share <= FOREGROUND_SHARE[1]:
        return ()
    return (
        f"masks cover {100 * share:.2g} % of the image "
        f"(usual: {100 * FOREGROUND_SHARE[0]:g} to {100 * FOREGROUND_SHARE[1]:g} %): "
        "inverted, empty, or a person far away?",
    )


def check_masks(masks: Iterable[int], frames: Iterable[int]) -> tuple[str, ...]:
    """Whether masks and frames belong together: masks of frames that do not exist show a shift."""
    foreign = sorted(set(masks) - set(frames))
    if not foreign:
        return ()
    return (f"{len(foreign)} masks belong to no frame, the first {foreign[0]}: off by one?",)


def check_rate(stated_fps: float | None, scene_fps: float) -> tuple[str, ...]:
    """Whether the video's own rate is the scene's; a wrong one makes motion too fast or slow."""
    if stated_fps is None or abs(stated_fps / scene_fps - 1) <= RATE_TOLERANCE:
        return ()
    return (f"the video says {stated_fps:.4g} frames per second, scene.json {scene_fps:.4g}",)


def _principal_point(camera: Camera) -> list[str]:
    cx, cy = camera.K[0, 2], camera.K[1, 2]
    if 0 <= cx <= camera.width and 0 <= cy <= camera.height:
        return []
    return [
        f"the principal point ({cx:.0f}, {cy:.0f}) of {camera.name} lies outside its "
        f"{camera.width} x {camera.height} image: swapped sizes, or K of another resolution?"
    ]


def _focal_length(camera: Camera) -> list[str]:
    fx, fy = float(camera.K[0, 0]), float(camera.K[1, 1])
    side = max(camera.width, camera.height)
    view_deg = float(np.degrees(2 * np.arctan(side / (2 * np.sqrt(fx * fy)))))
    warnings = []
    if not FIELD_OF_VIEW_DEG[0] <= view_deg <= FIELD_OF_VIEW_DEG[1]:
        warnings.append(
            f"{camera.name} sees {view_deg:.3g} degrees "
            f"(usual: {FIELD_OF_VIEW_DEG[0]:g} to {FIELD_OF_VIEW_DEG[1]:g}): "
            "a focal length that is not in pixels of this size?"
        )
    if abs(fx / fy - 1) > SQUARE_PIXELS:
        warnings.append(f"pixels of {camera.name} are not square: fx {fx:.0f}, fy {fy:.0f}")
    return warnings
