"""Conditions under which a run may stop before its schedule's end, as people write them."""

from __future__ import annotations

import math

from mocoflow_core.errors import InputError

# Other scores are of cameras that nothing may be learned from, not even when to stop.
SCORE = "train_psnr"


def read_target(text: str) -> str:
    """``train_psnr=30`` as a setting of the schedule.

    Raises InputError for another score, or a value that is no number of decibels above 0.
    """
    name, equals, value = text.partition("=")
    if name.strip() != SCORE or not equals:
        raise InputError(
            f"--until must be {SCORE}=DECIBELS",
            repr(text),
            f"Write --until {SCORE}=30; only pixels of the train camera may end a run.",
        )
    try:
        decibels = float(value)
    except ValueError:
        decibels = math.nan
    if not 0.0 < decibels < math.inf:
        raise InputError(
            f"--until {SCORE} must be decibels above 0",
            repr(value),
            f"Write --until {SCORE}=30.",
        )
    return f"schedule.until_{SCORE}={decibels}"
