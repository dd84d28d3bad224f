"""Why something ended, in words."""

from __future__ import annotations

from mocoflow_core.errors import InputError


def reason_of(error: BaseException) -> str:
    """On one line; bad input speaks for itself, other errors say what they are."""
    text = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
