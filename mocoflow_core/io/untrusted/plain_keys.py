"""What may be the key of a dict."""

from __future__ import annotations

from mocoflow_core.errors import InputError


def plain_key(key: object) -> str | bytes | int:
    """The key itself.

    Raises:
        InputError: it is no text and no whole number of 64 bits. Tuples within tuples take for
            ever to hash, and long numbers can be chosen so that their hashes meet.
    """
    if isinstance(key, str | bytes) or (isinstance(key, int) and -(2**63) <= key < 2**64):
        return key
    raise InputError(
        "its dicts must have text or whole numbers as keys",
        f"one with {type(key).__name__}",
        "Save it with plain keys.",
    )
