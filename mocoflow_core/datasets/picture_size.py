"""Pictures have the size that their calibration says."""

from __future__ import annotations

from mocoflow_core.errors import InputError

Size = tuple[int, int]  # width, height


def require_size(found: Size, calibrated: Size, what: str) -> None:
    """Raise InputError where a picture's width and height are not those of the calibration."""
    if found != calibrated:
        raise InputError(
            f"{what} must be {calibrated[0]} x {calibrated[1]} as the calibration says",
            f"{found[0]} x {found[1]}",
            "It was turned, cropped or resized since, or is of another release: undo that, for "
            "example with ffmpeg's filters transpose and crop.",
        )
