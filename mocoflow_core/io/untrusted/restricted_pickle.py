"""A pickle machine that can only make data.

Why not ``pickle.Unpickler`` with a ``find_class`` of our own: joblib puts raw bytes between the
instructions, which the C machine cannot hand over; a single instruction makes it reserve gigabytes
(LONG_BINPUT, BYTEARRAY8); and REDUCE and BUILD still call into NumPy with whatever the file says.
This machine takes some 1.5 microseconds an instruction, twice as long as the standard library's
own in Python and thirty times as long as the one in C. That is enough: the bulk of every file is
arrays, and those are one instruction each.

Source: CPython, ``Lib/pickletools.py``, protocols 0 to 5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mocoflow_core.io.untrusted.admitted_names import admitted, forbidden
from mocoflow_core.io.untrusted.byte_stream import ByteStream
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.pickle_literals import LITERALS, memo_place
from mocoflow_core.io.untrusted.plain_keys import plain_key
from mocoflow_core.io.untrusted.plain_tree import plain_tree
from mocoflow_core.io.untrusted.records import Admitted, Outside, Record
from mocoflow_core.io.untrusted.refusal import damaged

# The attribute of a torch state dict with its modules' versions, which are of no use to us.
_VERSIONS = "_metadata"
_NEWEST_PROTOCOL = 5


def read_pickle_stream(stream: ByteStream, allowance: Allowance) -> object:
    """The plain structure in a pickle or an uncompressed joblib file.

    Raises:
        InputError: the file is damaged, asks for a name outside the table, or for too much.
    """
    return plain_tree(PickleMachine(stream, allowance).run(), allowance)


class PickleMachine:
    """Runs one pickle; its result may hold records that are yet to be made plain."""

    def __init__(
        self, stream: ByteStream, allowance: Allowance, outside: Outside | None = None
    ) -> None:
        self.stream = stream
        self.allowance = allowance
        self._outside = outside  # resolves references to data outside of the pickle
        self._stack: list[object] = []
        self._below: list[list[object]] = []  # stacks under the open marks
        self._memo: dict[int, object] = {}

    def run(self) -> object:
        """Follow the instructions up to STOP."""
        take, spend = self.stream.take, self.allowance.spend_step
        while True:
            spend()
            code = take(1)
            literal = LITERALS.get(code)
            if literal is not None:
                self._stack.append(literal(self.stream))
            elif code == b".":
                return self._result()
            else:
                self._follow(code)

    def _result(self) -> object:
        if not self._stack:
            raise damaged("a pickle without a result")
        return self._stack.pop()

    def nested(self, stream: ByteStream, outside: Outside | None) -> object:
        """What a pickle within this one holds, under the same allowance."""
        return PickleMachine(stream, self.allowance, outside).run()

    def _follow(self, code: bytes) -> None:
        instruction = _INSTRUCTIONS.get(code)
        if instruction is None:
            raise damaged(f"an unknown pickle instruction {code!r}")
        try:
            instruction(self)
        except (IndexError, KeyError) as error:
            raise damaged("a pickle whose instructions refer to nothing") from error

    # Stack and memo

    def _mark(self) -> None:
        self._below.append(self._stack)
        self._stack = []

    def _since_mark(self) -> list[object]:
        items = self._stack
        self._stack = self._below.pop()
        return items

    def _drop_marked(self) -> None:
        self._since_mark()

    def _pop(self) -> None:
        if self._stack:
            self._stack.pop()
        else:
            self._drop_marked()

    def _duplicate(self) -> None:
        self._stack.append(self._stack[-1])

    def _put(self, width: int) -> None:
        self._memo[memo_place(self.stream, width)] = self._stack[-1]

    def _get(self, width: int) -> None:
        self._stack.append(self._memo[memo_place(self.stream, width)])

    def _memoise(self) -> None:
        self._memo[len(self._memo)] = self._stack[-1]

    def _protocol(self) -> None:
        if self.stream.take(1)[0] > _NEWEST_PROTOCOL:
            raise damaged("a pickle of an unknown protocol")

    def _frame(self) -> None:
        # A hint for reading ahead; every length is checked where it counts.
        self.stream.take(8)

    # Containers

    def _tuple(self, count: int) -> None:
        items = [self._stack.pop() for _ in range(count)]
        self._stack.append(tuple(reversed(items)))

    def _marked_tuple(self) -> None:
        items = self._since_mark()
        self._stack.append(tuple(items))

    def _marked_list(self) -> None:
        items = self._since_mark()
        self._stack.append(items)

    def _marked_dict(self) -> None:
        items = self._since_mark()
        self._stack.append({})
        self._set(items)

    def _append(self) -> None:
        item = self._stack.pop()
        self._extend([item])

    def _extend(self, items: list[object]) -> None:
        target = self._stack[-1]
        if not isinstance(target, list):
            raise damaged("items for something that is no list")
        target.extend(items)

    def _set_one(self) -> None:
        value, key = self._stack.pop(), self._stack.pop()
        self._set([key, value])

    def _set(self, items: list[object]) -> None:
        target = self._stack[-1]
        if not isinstance(target, dict) or len(items) % 2:
            raise damaged("pairs for something that is no dict")
        for key, value in zip(items[::2], items[1::2], strict=True):
            target[plain_key(key)] = value

    # Names and objects

    def _global(self) -> None:
        module, name = (self.stream.line().decode("utf-8") for _ in range(2))
        self._stack.append(admitted(module, name))

    def _stack_global(self) -> None:
        name, module = self._stack.pop(), self._stack.pop()
        self._stack.append(admitted(module, name))

    def _reduce(self) -> None:
        arguments, function = self._stack.pop(), self._stack.pop()
        if not isinstance(function, Admitted) or not isinstance(arguments, tuple):
            raise damaged("a call of something that is no function")
        if function.call is None:
            raise forbidden(f"{function.name}(...)")
        self._stack.append(function.call(arguments, self))

    def _new(self) -> None:
        arguments, kind = self._stack.pop(), self._stack.pop()
        if not isinstance(kind, Admitted):
            raise damaged("an object without a class")
        if kind.new is None or arguments != ():
            raise forbidden(f"{kind.name}(...)")
        self._stack.append(kind.new())

    def _build(self) -> None:
        state, target = self._stack.pop(), self._stack[-1]
        if isinstance(target, dict) and isinstance(state, dict) and state.keys() == {_VERSIONS}:
            return
        if not isinstance(target, Record):
            raise damaged("a state for something that has none")
        target.build(state, self)

    def _instance(self) -> None:
        module, name = (self.stream.line().decode("utf-8") for _ in range(2))
        raise forbidden(f"{module}.{name}")

    def _refer(self) -> None:
        if self._outside is None:
            raise damaged("a reference to data outside the file")
        self._stack.append(self._outside(self._stack.pop()))

    def _refused(self) -> None:
        raise forbidden("an object by extension code, old-style class or buffer outside the file")


_INSTRUCTIONS: Mapping[bytes, Callable[[PickleMachine], None]] = {
    b"\x80": PickleMachine._protocol,
    b"\x95": PickleMachine._frame,
    b"(": PickleMachine._mark,
    b"0": PickleMachine._pop,
    b"1": PickleMachine._drop_marked,
    b"2": PickleMachine._duplicate,
    b"p": lambda m: m._put(0),
    b"q": lambda m: m._put(1),
    b"r": lambda m: m._put(4),
    b"\x94": PickleMachine._memoise,
    b"g": lambda m: m._get(0),
    b"h": lambda m: m._get(1),
    b"j": lambda m: m._get(4),
    b"\x85": lambda m: m._tuple(1),
    b"\x86": lambda m: m._tuple(2),
    b"\x87": lambda m: m._tuple(3),
    b"t": PickleMachine._marked_tuple,
    b"l": PickleMachine._marked_list,
    b"d": PickleMachine._marked_dict,
    b"]": lambda m: m._stack.append([]),
    b"}": lambda m: m._stack.append({}),
    b"\x8f": lambda m: m._stack.append([]),  # a set
    b"\x90": lambda m: m._extend(m._since_mark()),
    b"\x91": PickleMachine._marked_list,  # a frozenset
    b"a": PickleMachine._append,
    b"e": lambda m: m._extend(m._since_mark()),
    b"s": PickleMachine._set_one,
    b"u": lambda m: m._set(m._since_mark()),
    b"c": PickleMachine._global,
    b"\x93": PickleMachine._stack_global,
    b"R": PickleMachine._reduce,
    b"\x81": PickleMachine._new,
    b"b": PickleMachine._build,
    b"i": PickleMachine._instance,
    b"o": PickleMachine._refused,
    b"Q": PickleMachine._refer,
    b"P": PickleMachine._refused,
    b"\x82": PickleMachine._refused,
    b"\x83": PickleMachine._refused,
    b"\x84": PickleMachine._refused,
    b"\x92": PickleMachine._refused,
    b"\x97": PickleMachine._refused,
    b"\x98": PickleMachine._refused,
}
