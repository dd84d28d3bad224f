"""Frames of a clip that cannot be what the camera saw, and masks that say less than their frame.

A stationary camera shows the same background in every frame. A black, white or garbled frame does
not; it would be learned as colour. An empty mask says that nobody is there; where the frame shows
somebody, it would teach the model to make the person vanish.

What is usual is measured on training frames alone: held-out frames are judged, and judge nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.capture.clip import Clip
from mocoflow_core.progress import Progress, untold

Shares = NDArray[np.float64]

# The person's edge and shadow are no background: masks grow by this share of the longer side.
MARGIN = 0.03
# More of the background than this has changed: another picture, or none.
LARGEST_CHANGE = 0.5
# Where more frames than this differ from the plate, the plate is wrong or the camera moves.
FEW = 0.2
# What a frame shows besides its mask, in sizes of the usual person: more is another person, or a
# mask of another frame; half a person's size is what an empty mask leaves out.
LARGEST_SURPLUS = 0.5
USUAL_SURPLUS = 3.0  # times the clip's own, which shadows and passers-by may make large
# Masks do not grow to twice the size, or shrink to half of it, and come back in one frame.
LARGEST_JUMP = 2.0
# A frame lies between its neighbours. One that differs from both by so much more than they differ
# from each other, and by more than noise, is out of order.
LARGEST_DETOUR = 1.15
NOISE = 12.0  # of 255, mean over the person
LOOKED_AT_PX = 128  # longer side at which neighbours are compared


@dataclass(frozen=True, eq=False)
class FrameFindings:
    """What each frame (T,) shows besides its mask."""

    changed: Shares  # share of the background that differs from the plate
    surplus: Shares  # area that differs, in sizes of the usual person
    area: Shares  # pixels of the mask
    detour: Shares  # difference to both neighbours over their own; 0 where there are none


def sound_clip(
    clip: Clip, threshold: int, progress: Progress = untold
) -> tuple[Clip, tuple[str, ...]]:
    """The clip without broken frames and without empty masks where somebody is seen; warnings.

    Args:
        threshold: difference to the plate that counts as a change, in steps of 1/255.
    """
    found = measure_frames(clip, threshold, progress)
    training = ~clip.held_out
    broken = found.changed > LARGEST_CHANGE
    warnings = []
    if broken[training].mean() > FEW:
        warnings.append(
            f"{broken[training].sum()} of {training.sum()} frames differ from the background in "
            f"more than {100 * LARGEST_CHANGE:.0f} % of it: another plate, another exposure, or a "
            "camera that moves?"
        )
        broken[:] = False
    unseen = ~broken & (found.area == 0) & clip.has_mask
    silent = unseen & (found.surplus > LARGEST_SURPLUS)
    usual = float(np.median(found.surplus[training & ~broken]))
    limit = max(LARGEST_SURPLUS, USUAL_SURPLUS * usual)
    double = ~broken & ~unseen & (found.surplus > limit)
    jumping = _jumps(found.area, broken | unseen | ~clip.has_mask, training)
    odd = ~broken & (found.detour > LARGEST_DETOUR)
    warnings += [
        f"{_named(rows, clip)} {words}"
        for rows, words in (
            (
                broken,
                f"left out: more than {100 * LARGEST_CHANGE:.0f} % of the background has changed",
            ),
            (silent, "with an empty mask though somebody is seen: counted as without a mask"),
            (unseen & ~silent, "with an empty mask: nobody is to be seen there"),
            (double, "showing more than mask and background: of another moment, or two persons?"),
            (jumping, "with a mask of another size than before and after"),
            (odd, "unlike the frames before and after, which are alike: out of order?"),
        )
        if rows.any()
    ]
    return _selected(clip, ~broken, silent), tuple(warnings)


def measure_frames(clip: Clip, threshold: int, progress: Progress = untold) -> FrameFindings:
    """Compare every frame with the background plate outside its grown mask."""
    side = 2 * max(round(MARGIN * max(clip.masks.shape[1:])), 1) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    area = clip.masks.sum(axis=(1, 2)).astype(np.float64)
    shown = area[(area > 0) & ~clip.held_out]
    person = float(np.median(shown)) if len(shown) else np.inf
    changed, surplus = np.zeros(len(area)), np.zeros(len(area))
    for row, (frame, mask) in enumerate(zip(clip.frames, clip.masks, strict=True)):
        outside = cv2.dilate(mask.astype(np.uint8), kernel) == 0
        differs = cv2.absdiff(np.asarray(frame), clip.background).max(axis=-1) > threshold
        count = int((differs & outside).sum())
        changed[row] = count / max(int(outside.sum()), 1)
        surplus[row] = count / person
        progress((row + 1) / len(area), f"frame {clip.frame_indices[row]} checked")
    return FrameFindings(changed, surplus, area, _detours(clip))


def _detours(clip: Clip) -> Shares:
    """How much farther it is from a frame to both its neighbours than between these, (T,)."""
    stride = max(max(clip.masks.shape[1:]) // LOOKED_AT_PX, 1)
    frames = clip.frames[:, ::stride, ::stride].astype(np.float32)
    masks = clip.masks[:, ::stride, ::stride]
    result = np.zeros(len(frames))
    for before_row, row, after_row in _neighbours(np.arange(len(frames)), ~clip.held_out):
        person = masks[before_row] | masks[row] | masks[after_row]
        if person.any():
            before, frame, after = (frames[r][person] for r in (before_row, row, after_row))
            away = min(np.abs(frame - before).mean(), np.abs(frame - after).mean())
            if away > NOISE:
                result[row] = away / max(np.abs(after - before).mean(), NOISE)
    return result


def _jumps(
    area: Shares, doubtful: NDArray[np.bool_], training: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Masks whose size jumps against both neighbours, which agree."""
    result = np.zeros(len(area), bool)
    for before, row, after in _neighbours(np.flatnonzero(~doubtful), training):
        low, high = sorted((area[before], area[after]))
        agree = high < LARGEST_JUMP * low
        result[row] = agree and not low / LARGEST_JUMP < area[row] < high * LARGEST_JUMP
    return result


def _neighbours(
    rows: NDArray[np.int64], training: NDArray[np.bool_]
) -> Iterator[tuple[int, int, int]]:
    """Each of the rows between the nearest training frames among them, where it has both."""
    known = rows[training[rows]]
    for row in rows:
        earlier, later = known[known < row], known[known > row]
        if len(earlier) and len(later):
            yield int(earlier[-1]), int(row), int(later[0])


def _named(rows: NDArray[np.bool_], clip: Clip) -> str:
    numbers = clip.frame_indices[rows]
    return f"{listed(numbers.tolist())} of {clip.camera.name}"


def listed(numbers: Sequence[int]) -> str:
    """``frame 7`` or ``5 frames (3-6, 9)``: runs of numbers, the first few of them."""
    if len(numbers) == 1:
        return f"frame {numbers[0]}"
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    more = ", ..." if len(texts) > 6 else ""
    return f"{len(numbers)} frames ({', '.join(texts[:6])}{more})"


def _selected(clip: Clip, kept: NDArray[np.bool_], silent: NDArray[np.bool_]) -> Clip:
    if kept.all() and not silent.any():
        return clip
    return replace(
        clip,
        frame_indices=clip.frame_indices[kept],
        frames=clip.frames[kept],
        masks=clip.masks[kept],
        has_mask=(clip.has_mask & ~silent)[kept],
        held_out=clip.held_out[kept],
    )
