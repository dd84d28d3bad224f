"""Pickles of random instructions, which come further than random bytes do."""

from __future__ import annotations

from random import Random

GLOBALS = (
    b"cnumpy\nndarray\n",
    b"cnumpy\ndtype\n",
    b"cnumpy.core.multiarray\n_reconstruct\n",
    b"cnumpy.core.multiarray\nscalar\n",
    b"cnumpy.core.numeric\n_frombuffer\n",
    b"ccollections\nOrderedDict\n",
    b"ccollections\ndefaultdict\n",
    b"c__builtin__\ndict\n",
    b"c__builtin__\nset\n",
    b"c__builtin__\nbytes\n",
    b"c__builtin__\nobject\n",
    b"c_codecs\nencode\n",
    b"ccopy_reg\n_reconstructor\n",
    b"cchumpy.ch\nCh\n",
    b"cscipy.sparse.csc\ncsc_matrix\n",
    b"cjoblib.numpy_pickle\nNumpyArrayWrapper\n",
    b"ctorch._utils\n_rebuild_tensor_v2\n",
    b"ctorch.storage\n_load_from_bytes\n",
    b"ctorch\nFloatStorage\n",
)
VALUES = (
    b"N",
    b"\x88",
    b"\x89",
    b")",
    b"]",
    b"}",
    b"K\x00",
    b"K\x01",
    b"K\x03",
    b"J\xff\xff\xff\xff",
    b"M\xff\xff",
    b"G\x7f\xf8\x00\x00\x00\x00\x00\x00",
    b"\x8a\x09\x00\x00\x00\x00\x00\x00\x00\x00\x7f",
    b"U\x00",
    b"U\x01b",
    b"U\x01<",
    b"U\x01|",
    b"U\x02f8",
    b"U\x02O8",
    b"U\x02S1",
    b"U\x01x",
    b"U\x05shape",
    b"U\x05dtype",
    b"U\x08subclass",
    b"U\x04data",
    b"U\x07indices",
    b"U\x06indptr",
    b"U\x06_shape",
    b"U\x07storage",
    b"U\x08" + bytes(8),
    b"C\x08" + bytes(8),
    b"\x96\x08\x00\x00\x00\x00\x00\x00\x00" + bytes(8),
    b"X\x06\x00\x00\x00latin1",
)
# Whole objects, to be taken apart by what follows.
OBJECTS = (
    b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\x00tU\x01btR",
    b"cnumpy\ndtype\n(U\x02f8K\x00K\x01tR",
    b"cnumpy\ndtype\n(U\x02f8K\x00K\x01tR(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb",
    b"cnumpy\ndtype\n(U\x02O8K\x00K\x01tR",
    b"cjoblib.numpy_pickle\nNumpyArrayWrapper\n)\x81",
    b"cchumpy.ch\nCh\n)\x81}U\x01xK\x01sb",
)


# What an instruction takes off the stack and leaves there; below a mark nothing is taken.
ACTIONS = {
    b"R": (("global", "tuple"), "object"),
    b"\x81": (("global", "tuple"), "object"),
    b"b": (("object", "any"), "object"),
    b"a": (("list", "any"), "list"),
    b"s": (("dict", "any", "any"), "dict"),
    b"\x85": (("any",), "tuple"),
    b"\x86": (("any", "any"), "tuple"),
    b"\x87": (("any", "any", "any"), "tuple"),
    b"0": (("any",), None),
    b"2": (("any",), "any any"),
}
GATHERING = {b"t": "tuple", b"l": "list", b"d": "dict", b"\x91": "list"}
KINDS = {b"]": "list", b"}": "dict", b")": "tuple", b"\x8f": "list"}
NONSENSE = 0.02  # the share of instructions that need not fit


def random_pickle(random: Random) -> bytes:
    """Some dozen instructions, nearly all of which find on the stack what they take."""
    stack, parts = [], [b"\x80\x02"]
    for _ in range(random.randrange(1, 80)):
        parts.append(_step(random, stack))
        if random.random() < 0.1 and stack and stack[-1] != "mark":
            parts.append(b"q" + bytes([random.randrange(4)]))
    while "mark" in stack:
        parts.append(b"t")
        del stack[len(stack) - 1 - stack[::-1].index("mark") :]
    return b"".join(parts) + b"."


def _step(random: Random, stack: list[str]) -> bytes:
    """One instruction, and its effect on the kinds of values on the stack."""
    if random.random() < NONSENSE:
        return random.choice(
            [*ACTIONS, *GATHERING, b"u", b"e", b"h\x00", b"h\x01", b"1", b"o", b"Q", b"\x93"]
        )
    fitting = [code for code, (taken, _) in ACTIONS.items() if _fits(stack, taken)]
    if fitting and random.random() < 0.5:
        code = random.choice(fitting)
        taken, left = ACTIONS[code]
        del stack[len(stack) - len(taken) :]
        stack += left.split() if left else []
        return code
    if "mark" in stack and random.random() < 0.15:
        code = random.choice(list(GATHERING))
        del stack[len(stack) - 1 - stack[::-1].index("mark") :]
        stack.append(GATHERING[code])
        return code
    if random.random() < 0.1:
        stack.append("mark")
        return b"("
    pool, kind = random.choice(((VALUES, "any"), (GLOBALS, "global"), (OBJECTS, "object")))
    code = random.choice(pool)
    stack.append(KINDS.get(code, kind))
    return code


def _fits(stack: list[str], taken: tuple[str, ...]) -> bool:
    top = stack[len(stack) - len(taken) :]
    return len(top) == len(taken) and all(
        have != "mark" and want in ("any", have) for want, have in zip(taken, top, strict=True)
    )
