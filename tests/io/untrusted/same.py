"""Whether two plain structures are equal, arrays and their types included."""

from __future__ import annotations

import numpy as np


def same(found, expected) -> bool:
    if isinstance(expected, np.ndarray):
        alike = isinstance(found, np.ndarray) and found.dtype == expected.dtype
        return alike and np.array_equal(found, expected)
    if isinstance(expected, dict):
        return found.keys() == expected.keys() and all(same(found[k], expected[k]) for k in found)
    if isinstance(expected, list | tuple):
        alike = type(found) is type(expected) and len(found) == len(expected)
        return alike and all(same(a, b) for a, b in zip(found, expected, strict=True))
    return type(found) is type(expected) and found == expected
