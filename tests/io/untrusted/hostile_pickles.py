"""Pickles that would do something if anything in them ran."""

from __future__ import annotations

import pickle
from pathlib import Path


class Calling:
    """Pickles as a call of ``function`` with ``arguments``."""

    def __init__(self, function, *arguments):
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


def creating(sentinel: Path) -> dict[str, bytes]:
    """Pickles that create the file ``sentinel`` when the standard unpickler opens them."""
    import builtins
    import os
    import subprocess

    code = f"open({str(sentinel)!r}, 'w').close()"
    touch = f"touch {sentinel}"
    calls = {
        "system": Calling(os.system, touch),
        "eval": Calling(builtins.eval, code),
        "exec": Calling(builtins.exec, code),
        "open": Calling(builtins.open, str(sentinel), "w"),
        "popen": Calling(subprocess.check_output, ["touch", str(sentinel)]),
    }
    named = {
        f"{name}_{protocol}": pickle.dumps({"pose": [1.0], "x": call}, protocol)
        for name, call in calls.items()
        for protocol in (0, 2, 5)
    }
    return named | _by_hand(sentinel)


def _by_hand(sentinel: Path) -> dict[str, bytes]:
    touch = str(sentinel).encode()
    command = b"V" + b"touch " + touch + b"\n"
    return {
        # Instructions of protocols 0 and 1 that call without REDUCE.
        "inst": b"(" + command + b"ios\nsystem\n.",
        "obj": b"(cos\nsystem\n" + command + b"o.",
        # The name comes off the stack, where no scan for "os.system" in the bytes finds it.
        "stack_global": b"\x80\x04\x8c\x02os\x8c\x06system\x93" + command + b"\x85R.",
        # A way round through an attribute of something that is admitted.
        "dotted": b"\x80\x04\x8c\x05numpy\x8c\x17_core.numeric.sys.modules\x93.",
        "new": b"\x80\x02cos\nsystem\n" + command + b"\x85\x81.",
        "extension": b"\x80\x02\x82\x01.",
        "buffer": b"\x80\x05\x97.",
    }


FORBIDDEN = {
    "open": b"cbuiltins\nopen\n(V/etc/hostname\ntR.",
    "fromfile": b"cnumpy\nfromfile\n(V/etc/hostname\ntR.",
    "memmap": b"cnumpy\nmemmap\n(V/etc/hostname\ntR.",
    "load": b"cnumpy\nload\n(V/etc/hostname\ntR.",
    "joblib_load": b"cjoblib\nload\n(V/etc/hostname\ntR.",
    "joblib_outside_file": b"cjoblib.numpy_pickle_compat\nNDArrayWrapper\n)\x81.",
    "torch_load": b"ctorch\nload\n(V/etc/hostname\ntR.",
    "getattr": b"c__builtin__\ngetattr\n(cnumpy\nndarray\nVtofile\ntR.",
    "import": b"c__builtin__\n__import__\n(Vos\ntR.",
    "chumpy_path": b"cchumpy_evil.ch\nCh\n)\x81.",
    "codec": b"c_codecs\nencode\n(V00\nVhex\ntR.",
    "bytes_of": b"c__builtin__\nbytes\n(I9999999999\ntR.",
    "list_of": b"c__builtin__\nlist\n(V00\ntR.",
    "ndarray_of": b"cnumpy\nndarray\n((I4\ntVf8\ntR.",
    "factory": b"ccollections\ndefaultdict\n(cnumpy\nndarray\ntR.",
    "object": b"c__builtin__\nobject\n)\x81.",
    "persistent": b"Vsecret\nQ.",
    "persistent_line": b"Psecret\n.",
}
