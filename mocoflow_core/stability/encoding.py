"""Frequency bands at their highest, clips of extreme lengths, and the ends of the annealing."""

from __future__ import annotations

import math

import numpy as np
import torch

from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.fields.encoding import FrequencyEncoding, band_weights, most_bands
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.stability.case import Case, Found, largest, require

SINGLE = torch.finfo(torch.float32).eps
TIME_BANDS = 16  # of the paper
POSITION_BANDS = 8
BORDER = 1e-6
ENDS = (0.0, BORDER, 1.0 - BORDER, 1.0, 1.0 + BORDER, 4.5, 8.0 - BORDER, 8.0, 18.0)


def _exact(x: torch.Tensor, bands: int) -> torch.Tensor:
    """``sin, cos(2^k pi x)`` of each band in float64, (N, 2 bands), sines first."""
    angles = math.pi * 2.0 ** torch.arange(bands, dtype=torch.float64) * x.double()[:, None]
    return torch.cat([angles.sin(), angles.cos()], -1)


def _encoded(x: torch.Tensor, bands: int) -> torch.Tensor:
    encoding = FrequencyEncoding(1, bands)
    encoding.anneal(float(bands))
    return encoding(x[:, None])[:, 1:]


def _highest_band(band: float) -> Found:
    bands = int(band) + 1
    times = torch.linspace(0, 1, 997)
    found = _encoded(times, bands)
    off = (found.double() - _exact(times, bands))[:, [bands - 1, 2 * bands - 1]]
    return Found(largest(off), (found,))


def _short_numbers(bands: float) -> Found:
    """bfloat16 input either keeps the phase of the highest band or is refused in words."""
    times = torch.linspace(0, 1, 997, dtype=torch.float64)
    try:
        found = _encoded(times.bfloat16(), int(bands))
    except InputError as error:
        require("float32" in str(error), f"the refusal does not say what to do: {error}")
        require(bands > most_bands(torch.bfloat16), "refused although there are digits enough")
        return Found(0.0, remark="refused: " + str(error))
    require(bands <= most_bands(torch.bfloat16), "taken although the phase has no digits left")
    return Found(largest(found.double() - _exact(times, int(bands))), (found,))


def _clip_of(frames: int) -> Clip:
    camera = Camera("cam", 1, 1, np.eye(3), np.eye(3), np.zeros(3))
    nothing = np.zeros((frames, 1, 1), bool)
    return Clip(
        camera,
        12.0,
        np.arange(frames, dtype=np.int32),
        np.zeros((frames, 1, 1, 3), np.uint8),
        nothing,
        nothing[:, 0, 0],
        nothing[:, 0, 0],
        np.zeros((1, 1, 3), np.uint8),
    )


def _clip_length(frames: float) -> Found:
    times = torch.from_numpy(_clip_of(int(frames)).times)
    found = _encoded(times.float(), TIME_BANDS)
    apart = (found[1:] - found[:-1]).abs().amax(-1)
    require(bool((apart > 0).all()), "two frames have the same code")
    return Found(largest(found.double() - _exact(times, TIME_BANDS)), (found,))


def _annealing(band_alpha: float) -> Found:
    k = np.arange(POSITION_BANDS)
    share = np.clip(band_alpha - k, 0, 1)
    return Found(largest(band_weights(band_alpha, POSITION_BANDS).numpy() - _window(share)))


def _window(share: np.ndarray) -> np.ndarray:
    """``(1 - cos(pi share)) / 2`` without its cancellation at 0."""
    return np.sin(0.5 * np.pi * share) ** 2


def _annealing_slope(band_alpha: float) -> Found:
    """The slope by a one-sided difference on either side: the ends have neither jump nor kink."""
    h = 1e-4
    middle, before, after = (
        band_weights(band_alpha + step, POSITION_BANDS).numpy() for step in (0.0, -h, h)
    )
    kink = (after - middle) / h - (middle - before) / h
    return Found(largest(kink), (kink,))


def _far_outside(coordinate: float) -> Found:
    x = coordinate + torch.linspace(-1, 1, 97)
    found = _encoded(x, POSITION_BANDS)
    return Found(largest(found.double() - _exact(x, POSITION_BANDS)), (found,))


CASES = (
    Case(
        "highest_time_band",
        "2^15 pi t multiplies the rounding of t by a hundred thousand",
        "band",
        tuple(float(band) for band in range(TIME_BANDS)),
        "sine and cosine in float64 of the same t",
        _highest_band,
        lambda band: math.pi * 2**band * SINGLE + 2 * SINGLE,
        "",
        "the phase is rounded twice (2^k pi, and its product with t), each half a rounding of it",
    ),
    Case(
        "bfloat16_time",
        "bfloat16 has 8 bits: from the third band on the phase is noise",
        "bands",
        (1.0, 2.0, 3.0, 4.0, 8.0, 16.0),
        "sine and cosine in float64, or a refusal in words",
        _short_numbers,
        2**-5 * math.pi,
        "",
        "bands are taken as long as a rounding of t moves the highest phase by less than pi / 32",
    ),
    Case(
        "clip_length",
        "one frame has no duration; frames of long clips are a ten-thousandth apart",
        "frames",
        (1.0, 2.0, 3.0, 1000.0, 10_000.0),
        "the code in float64 of the exact time; neighbours keep different codes",
        _clip_length,
        2 * math.pi * 2**15 * SINGLE,
        "",
        "the time's own rounding in float32 on top of the phase's two",
    ),
    Case(
        "annealing_ends",
        "the window joins constants with a cosine",
        "band_alpha",
        ENDS,
        "sin^2(pi share / 2), float64",
        _annealing,
        4 * torch.finfo(torch.float64).eps,
        "",
        "rounding of numbers of size one",
    ),
    Case(
        "annealing_slope",
        "a kink in the window would be a jump in every gradient",
        "band_alpha",
        ENDS,
        "one-sided slopes agree",
        _annealing_slope,
        0.5 * math.pi**2 * 1e-4 + 1e-8,
        "",
        "the second derivative is at most pi^2 / 2; the step is 1e-4",
    ),
    Case(
        "far_outside",
        "coordinates that were to lie in [-1, 1]",
        "coordinate",
        (0.0, 1.0, 1e2, 1e4, 1e6),
        "sine and cosine in float64 of the same coordinate",
        _far_outside,
        lambda x: math.pi * 2 ** (POSITION_BANDS - 1) * SINGLE * (1 + x) + 2 * SINGLE,
        "",
        "two half roundings of the phase, which grows with the coordinate",
    ),
)
