"""HDF5 files, read in a process of their own.

The HDF5 library is written in C and trusts its files: a few changed bytes can hang it, or worse.
So it runs apart, with its memory and time bounded, and hands over numbers only. When it dies or is
stopped, that is an error like any other.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.array_records import native, plain_dtype
from mocoflow_core.io.untrusted.limits import Allowance
from mocoflow_core.io.untrusted.records import integers
from mocoflow_core.io.untrusted.refusal import damaged

MAGIC = b"\x89HDF\r\n\x1a\n"

_PROGRAM = Path(__file__).with_name("hdf5_child.py")
_LONGEST_LINE = 10_000
# An empty list of libraries to load: filters come from h5py itself, never from a folder.
_NO_PLUGINS = {"HDF5_PLUGIN_PRELOAD": "::"}


@dataclass(frozen=True)
class ArrayShape:
    """What a data set is, without its content."""

    shape: tuple[int, ...]
    dtype: np.dtype

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def read_datasets(path: Path, allowance: Allowance) -> dict[str, NDArray[np.generic]]:
    """Every data set by its full name."""
    result = {}
    with _answers(path, allowance, None, None, content=True) as answers:
        while (described := _described(answers, allowance)) is not None:
            name, shape = described
            result[name] = _content(answers, shape, allowance)
    return result


def read_shapes(path: Path, allowance: Allowance) -> dict[str, ArrayShape]:
    """The shape and type of every data set by its full name."""
    result = {}
    with _answers(path, allowance, None, None, content=False) as answers:
        while (described := _described(answers, allowance)) is not None:
            result[described[0]] = described[1]
    return result


def read_rows(
    path: Path, name: str, rows: Sequence[int], allowance: Allowance
) -> Iterator[NDArray[np.generic]]:
    """The given rows of one data set, one after the other."""
    with _answers(path, allowance, name, rows, content=True) as answers:
        for row in rows:
            described = _described(answers, allowance)
            if described is None:
                raise damaged(f"no row {row} in {name!r}")
            # One row at a time is in memory: it is not counted against the whole file.
            yield _content(answers, described[1], Allowance(allowance.limits, allowance.file_bytes))


class _Answers:
    """What the reading process says; one that is silent for too long is stopped.

    Its own bound counts computing alone: a file that makes it wait would not end otherwise.
    """

    def __init__(self, process: subprocess.Popen[bytes], output: BinaryIO, seconds: int) -> None:
        self._process = process
        self._output = output
        self._seconds = seconds

    def line(self) -> bytes:
        with self._patience():
            return self._output.readline(_LONGEST_LINE)

    def fill(self, target: memoryview) -> None:
        done = 0
        while done < target.nbytes:
            with self._patience():
                count = self._output.readinto(target[done:])  # type: ignore[attr-defined]
            if not count:
                raise damaged("an HDF5 file that cannot be read to its end")
            done += count

    def require_end(self) -> None:
        with self._patience():
            status = self._process.wait()
        if status != 0:
            raise damaged("an HDF5 file that cannot be read to its end")

    @contextmanager
    def _patience(self) -> Iterator[None]:
        timer = Timer(self._seconds, self._process.kill)
        timer.start()
        try:
            yield
        finally:
            timer.cancel()


@contextmanager
def _answers(
    path: Path, allowance: Allowance, name: str | None, rows: Sequence[int] | None, content: bool
) -> Iterator[_Answers]:
    request = {
        "path": str(path.absolute()),
        "name": name,
        "rows": None if rows is None else [int(row) for row in rows],
        "bytes": allowance.left_bytes if content else 0,
        "seconds": allowance.limits.seconds,
        "members": allowance.limits.members,
    }
    # -P: the folder of the program is no place to import from.
    process = subprocess.Popen(
        [sys.executable, "-P", str(_PROGRAM)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | _NO_PLUGINS,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(request).encode() + b"\n")
        process.stdin.close()
        answers = _Answers(process, process.stdout, allowance.limits.seconds)  # type: ignore[arg-type]
        yield answers
        answers.require_end()
    finally:
        process.kill()
        process.stdout.close()
        process.wait()


def _described(answers: _Answers, allowance: Allowance) -> tuple[str, ArrayShape] | None:
    line = answers.line()
    if not line:
        return None
    answer = json.loads(line)
    if not isinstance(answer, dict):
        raise damaged("an HDF5 file that cannot be read to its end")
    if "refused" in answer:
        required, found, action = answer["refused"]
        raise InputError(str(required), str(found), str(action))
    dtype = plain_dtype(answer["dtype"])
    if dtype is None:
        raise damaged("objects in an HDF5 file")
    shape = integers(answer["shape"], allowance.limits.dimensions)
    return str(answer["name"]), ArrayShape(shape, dtype)


def _content(answers: _Answers, expected: ArrayShape, allowance: Allowance) -> NDArray[np.generic]:
    allowance.spend_bytes(expected.nbytes)
    array = np.empty(expected.shape, expected.dtype)
    if array.nbytes:
        answers.fill(memoryview(array.reshape(-1).view(np.uint8)))  # type: ignore[arg-type]
    return native(array)
