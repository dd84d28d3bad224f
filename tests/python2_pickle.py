"""Pickles as Python 2 wrote them: text is bytes, names are the old ones, classes need not exist."""

from __future__ import annotations

import io
import pickle
from dataclasses import dataclass, field
from struct import pack
from typing import ClassVar


@dataclass(eq=False)
class Forged:
    """An object of a class that is not installed here: its names, and the state it is given."""

    module: str
    name: str
    state: dict = field(default_factory=dict)


class _Python2Pickler(pickle._Pickler):
    dispatch: ClassVar = dict(pickle._Pickler.dispatch)

    def __init__(self, file, protocol):
        super().__init__(file, protocol, fix_imports=True)

    def save(self, obj, save_persistent_id=True):
        if type(obj) is str:
            self._save_text(obj.encode("latin1"))
        elif type(obj) is bytes:
            self._save_text(obj)
        elif type(obj) is Forged:
            self._save_forged(obj)
        elif type(obj) is set:
            self.save_reduce(set, (list(obj),))
        else:
            super().save(obj, save_persistent_id)

    def save_global(self, obj, name=None):
        if obj.__module__.startswith("numpy."):
            module = obj.__module__.replace("numpy._core", "numpy.core")
            self.write(f"c{module}\n{obj.__name__}\n".encode())
        else:
            super().save_global(obj, name)

    def _save_text(self, data):
        known = self.memo.get(("text", data))
        if known is not None:
            self.write(self.get(known))
            return
        if not self.bin:
            # Python 2 wrote the repr of its text.
            self.write(b"S" + repr(data)[1:].encode() + b"\n")
        elif len(data) < 256:
            self.write(b"U" + pack("<B", len(data)) + data)
        else:
            self.write(b"T" + pack("<i", len(data)) + data)
        place = len(self.memo)
        self.write(self.put(place))
        self.memo["text", data] = place

    def _save_forged(self, obj):
        known = self.memo.get(id(obj))
        if known is not None:
            self.write(self.get(known[0]))
            return
        name = f"c{obj.module}\n{obj.name}\n".encode()
        if self.proto >= 2:
            self.write(name + b")\x81")
        else:
            self.write(b"ccopy_reg\n_reconstructor\n(" + name + b"c__builtin__\nobject\nNtR")
        self.memoize(obj)
        self.save(obj.state)
        self.write(b"b")

    def put(self, idx):
        if not self.bin:
            return b"p%d\n" % idx
        return b"q" + pack("<B", idx) if idx < 256 else b"r" + pack("<I", idx)

    def get(self, i):
        if not self.bin:
            return b"g%d\n" % i
        return b"h" + pack("<B", i) if i < 256 else b"j" + pack("<I", i)

    for _kind, _save in list(dispatch.items()):
        if _save is pickle._Pickler.save_global:
            dispatch[_kind] = save_global


def python2_pickle(value, protocol: int = 2) -> bytes:
    """``value`` as Python 2's cPickle would have written it, protocol 0 to 2."""
    file = io.BytesIO()
    _Python2Pickler(file, protocol).dump(value)
    return file.getvalue()
