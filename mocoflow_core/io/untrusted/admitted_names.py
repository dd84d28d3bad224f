"""The global names that a pickle may use, in every spelling. Nothing else gets in.

Python 2 says ``__builtin__`` and ``copy_reg``; NumPy 2 says ``numpy._core``. The file's own
spelling is compared, nothing is translated, and no name is ever looked up outside this table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import array_records
from mocoflow_core.io.untrusted.body_model_records import SparseColumnsRecord, StateRecord
from mocoflow_core.io.untrusted.joblib_arrays import WRAPPER, WrapperRecord
from mocoflow_core.io.untrusted.plain_keys import plain_key
from mocoflow_core.io.untrusted.records import Admitted, Machine, Record
from mocoflow_core.io.untrusted.refusal import damaged
from mocoflow_core.io.untrusted.torch_tensors import TORCH_NAMES

DICT = Admitted("builtins.dict")
LIST = Admitted("builtins.list")
OBJECT = Admitted("builtins.object")

MAY_HOLD = (
    "numbers, text, lists, dicts, NumPy arrays, joblib arrays, torch tensors, "
    "and the chumpy arrays and sparse matrices of body models"
)


def admitted(module: object, name: object) -> Admitted:
    """What stands for a global name. Raises InputError for all that are not in the table."""
    # Anything else must not even be printed: its text may be endless.
    if not isinstance(module, str) or not isinstance(name, str):
        raise damaged("a name that is no text")
    full_name = f"{module}.{name}"
    if full_name in _NAMES:
        return _NAMES[full_name]
    if module.split(".")[0] == "chumpy":
        return Admitted(full_name, new=StateRecord)
    raise forbidden(full_name)


def forbidden(name: str) -> InputError:
    """The error for a file that wants to use something else."""
    return InputError(
        f"it may hold only {MAY_HOLD}",
        f"a file that asks for {name[:120]!r}",
        "It was not opened further and nothing of it ran. Get it from its maker as plain arrays.",
    )


def _ordered_dict(arguments: Sequence[object], machine: Machine) -> dict[object, object]:
    """``OrderedDict()`` or, from Python 2, ``OrderedDict([[key, value], ...])``."""
    (pairs,) = arguments or ([],)
    if not isinstance(pairs, list):
        raise damaged("an OrderedDict that is not made of pairs")
    machine.allowance.spend_step(len(pairs))
    result: dict[object, object] = {}
    for pair in pairs:
        key, value = pair if isinstance(pair, list | tuple) else ()
        result[plain_key(key)] = value
    return result


def _default_dict(arguments: Sequence[object], machine: Machine) -> dict[object, object]:
    """``defaultdict(dict)``; the factory is dropped."""
    if any(factory not in (None, DICT, LIST) for factory in arguments) or len(arguments) > 1:
        raise InputError(
            "it may hold a defaultdict of dict or list only",
            "one of something else",
            "Save it as a plain dict.",
        )
    return {}


def _latin1(arguments: Sequence[object], machine: Machine) -> bytes:
    """``_codecs.encode(text, 'latin1')``, as protocol 2 spells bytes; no other codec."""
    text, codec = arguments
    if not isinstance(text, str) or codec not in ("latin1", "latin-1"):
        raise forbidden("_codecs.encode with another codec than latin1")
    machine.allowance.spend_copy(len(text))
    return text.encode("latin1")


def _no_bytes(arguments: Sequence[object], machine: Machine) -> bytes:
    """``bytes()``, as protocol 2 spells the empty ones."""
    if arguments:
        raise forbidden("builtins.bytes of something")
    return b""


def _items(arguments: Sequence[object], machine: Machine) -> list[object]:
    """``set([...])`` as a list: its items are not needed in a hash table."""
    (items,) = arguments or ([],)
    if not isinstance(items, list | tuple):
        raise damaged("a set that is not made of a list")
    machine.allowance.spend_step(len(items))
    return list(items)


def _reconstructor(arguments: Sequence[object], machine: Machine) -> Record:
    """``copyreg._reconstructor(cls, object, None)``, as protocols 0 and 1 make an object."""
    kind, base, state = arguments
    if not isinstance(kind, Admitted) or kind.new is None or base is not OBJECT:
        raise damaged("an object of a strange class")
    if state is not None:
        raise damaged("an object with a strange state")
    return kind.new()


def _spelled(modules: Sequence[str], entry: Admitted) -> Mapping[str, Admitted]:
    name = entry.name.rsplit(".", 1)[1]
    return {f"{module}.{name}": entry for module in modules}


_BUILTINS = ("builtins", "__builtin__")
_MULTIARRAY = ("numpy.core.multiarray", "numpy._core.multiarray")
_NUMERIC = ("numpy.core.numeric", "numpy._core.numeric")
_SPARSE = ("scipy.sparse.csc", "scipy.sparse._csc")
_NAMES: Mapping[str, Admitted] = {
    **_spelled(("numpy",), array_records.NDARRAY),
    **_spelled(("numpy",), Admitted("numpy.dtype", array_records.dtype)),
    **_spelled(_MULTIARRAY, Admitted("multiarray._reconstruct", array_records.reconstruct)),
    **_spelled(_MULTIARRAY, Admitted("multiarray.scalar", array_records.scalar)),
    **_spelled(_NUMERIC, Admitted("numeric._frombuffer", array_records.from_buffer)),
    **_spelled(_BUILTINS, DICT),
    **_spelled(_BUILTINS, LIST),
    **_spelled(_BUILTINS, OBJECT),
    **_spelled(_BUILTINS, Admitted("builtins.bytes", _no_bytes)),
    **_spelled(_BUILTINS, Admitted("builtins.set", _items)),
    **_spelled(("collections",), Admitted("collections.OrderedDict", _ordered_dict)),
    **_spelled(("collections",), Admitted("collections.defaultdict", _default_dict)),
    **_spelled(("_codecs",), Admitted("_codecs.encode", _latin1)),
    **_spelled(("copyreg", "copy_reg"), Admitted("copyreg._reconstructor", _reconstructor)),
    **_spelled(_SPARSE, Admitted("scipy.sparse.csc_matrix", new=SparseColumnsRecord)),
    WRAPPER: Admitted(WRAPPER, new=WrapperRecord),
    **TORCH_NAMES,
}
