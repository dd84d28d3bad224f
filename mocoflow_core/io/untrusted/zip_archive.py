"""ZIP archives of strangers, read member by member within the allowance."""

from __future__ import annotations

import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted.limits import Allowance, OwnBytes
from mocoflow_core.io.untrusted.refusal import damaged

_ENCRYPTED = 0x1
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class ZipArchive:
    """An open archive whose directory has been checked; nothing is ever unpacked to a disk."""

    def __init__(self, archive: zipfile.ZipFile, size: int, allowance: Allowance) -> None:
        self._archive = archive
        self._allowance = allowance
        self._own = OwnBytes(size)
        members = archive.infolist()
        if len(members) > allowance.limits.members:
            raise damaged(f"an archive of {len(members):,} entries")
        for member in members:
            _require_plain(member)
        self._members = {member.filename: member for member in members}
        if len(self._members) != len(members):
            raise damaged("an archive with two entries of one name")

    @property
    def names(self) -> list[str]:
        return list(self._members)

    def read(self, name: str) -> bytes:
        """The bytes of a member.

        Raises:
            InputError: there is no such member, it grows beyond the limits, or is damaged.
        """
        member = self._members.get(name)
        if member is None:
            raise damaged(f"an archive without {name[:120]!r}")
        # The entry, and the array that is made of it.
        self._allowance.spend_bytes(2 * self._own.beyond(member.file_size))
        with self._archive.open(member) as file:
            # One byte more, to meet a member that is longer than it says.
            data = file.read(member.file_size + 1)
        if len(data) != member.file_size:
            raise damaged(f"{name[:80]} of another length than declared")
        return data


@contextmanager
def open_zip(path: Path, allowance: Allowance) -> Iterator[ZipArchive]:
    """The archive at ``path``, or InputError where an entry is not what a data file needs."""
    file: BinaryIO
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        yield ZipArchive(archive, file.seek(0, 2), allowance)


def _require_plain(member: zipfile.ZipInfo) -> None:
    name = PurePosixPath(member.filename.replace("\\", "/"))
    mode = member.external_attr >> 16
    found = None
    if name.is_absolute() or ".." in name.parts or ":" in member.filename:
        found = "a path that leads outside"
    elif stat.S_ISLNK(mode):
        found = "a symbolic link"
    elif member.flag_bits & _ENCRYPTED:
        found = "an encrypted entry"
    elif member.compress_type not in _METHODS:
        found = "an unusual compression"
    if found:
        raise InputError(
            "it must be an archive of plain entries",
            f"{found} ({member.filename[:80]!r})",
            "Get the file from its maker again.",
        )
