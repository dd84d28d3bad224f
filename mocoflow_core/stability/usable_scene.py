"""What is left of the toy scene after something went wrong, against the undisturbed one."""

from __future__ import annotations

from collections.abc import Sequence

from mocoflow_core.stability.case import Found
from mocoflow_core.stability.toy_scene import Outcome, undisturbed

# A scene is usable as long as it is not much worse than the posed body without any colours.
USABLE_DB = 3.0
WHY_USABLE = (
    "a posed body of one colour is 2 dB below the undisturbed scene, one gone astray 4 to 9 dB"
)


def lost(outcome: Outcome, noticed: Sequence[str]) -> Found:
    """Decibels below the undisturbed scene, at unseen views; what was noticed is the remark."""
    words = f"{outcome.psnr:.1f} dB. {'; '.join(noticed[:3])}".strip()
    return Found(
        max(undisturbed().psnr - outcome.psnr, 0.0), (*outcome.weights, outcome.psnr), words
    )
