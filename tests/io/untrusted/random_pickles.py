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
    b"cos\nsystem\n",
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
ACTIONS = (
    *(b"(", b"(", b"0", b"1", b"2", b"t", b"l", b"d", b"a", b"e", b"s", b"u", b"R", b"R", b"R"),
    *(b"b", b"b", b"\x81", b"\x81", b"\x85", b"\x86", b"\x87", b"\x94", b"\x93", b"\x90", b"\x91"),
    *(b"q\x00", b"q\x01", b"h\x00", b"h\x01", b"Q", b"o", b"\x8f", b"."),
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


def random_pickle(random: Random) -> bytes:
    """A few dozen instructions, mostly in an order that makes some sense."""
    pools = (VALUES, VALUES, ACTIONS, ACTIONS, GLOBALS, OBJECTS)
    parts = [random.choice(random.choice(pools)) for _ in range(random.randrange(1, 60))]
    return b"\x80\x02" + b"".join(parts) + b"."
