"""Pickles as Python 2 wrote them: protocol 2, byte strings for all text, NumPy's old names."""

from __future__ import annotations

import io
import pickle
import struct
from typing import ClassVar


def python2_pickle(value: object) -> bytes:
    """The bytes of a pickle that Python 2 would have written."""
    file = io.BytesIO()
    _Python2Pickler(file, protocol=2).dump(value)
    # NumPy 2 has moved its functions; a global's name stands as plain text.
    return file.getvalue().replace(b"cnumpy._core.", b"cnumpy.core.")


class _Python2Pickler(pickle._Pickler):
    dispatch: ClassVar = dict(pickle._Pickler.dispatch)

    def _save_string(self, value):
        raw = value.encode("latin1") if isinstance(value, str) else bytes(value)
        short = len(raw) < 256
        self.write(
            pickle.SHORT_BINSTRING + bytes([len(raw)]) + raw
            if short
            else pickle.BINSTRING + struct.pack("<i", len(raw)) + raw
        )
        self.memoize(value)

    dispatch[str] = _save_string
    dispatch[bytes] = _save_string
