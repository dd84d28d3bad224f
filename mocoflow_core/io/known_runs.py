"""The runs that a store knows of, and which of its artifacts they need.

A run writes itself down under ``runs/`` of its store when it takes its folder, and adds every
artifact as it uses it. Who collects garbage keeps what the runs need whose folders are still there.
"""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import RUN, RunRecord

RUNS = "runs"  # beside the folders of the stages


class KnownRun(BaseModel):
    """One run: its folder, the machine that the folder is on, the artifacts that it has used.

    ``host`` is the machine's name, for people; ``machine`` tells it from others, and is empty in
    records from before there was such a thing.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    folder: str
    host: str
    machine: str = ""
    artifacts: tuple[str, ...] = ()  # as "<stage>/<key>"

    @classmethod
    def here(cls, folder: Path, machine: str) -> KnownRun:
        return cls(folder=str(folder.resolve()), host=socket.gethostname(), machine=machine)

    @classmethod
    def read(cls, content: bytes | None) -> KnownRun | None:
        try:
            return None if content is None else cls.model_validate_json(content)
        except ValidationError:
            return None

    @property
    def file(self) -> str:
        """Its name in the store: a folder's next run takes the place of its last one."""
        where = f"{self.machine or self.host}\0{self.folder}"
        name = hashlib.sha256(where.encode()).hexdigest()[:16]
        return f"{RUNS}/{name}.json"

    def content(self) -> bytes:
        return (self.model_dump_json(indent=1) + "\n").encode()

    def using(self, artifacts: Iterable[str]) -> KnownRun:
        return self.model_copy(update={"artifacts": tuple(dict.fromkeys(artifacts))})

    def is_kept(self, machine: str) -> bool:
        """Whether its folder is still there; nobody here can say that another machine's is not."""
        return self.machine != machine or (Path(self.folder) / RUN).is_file()


class RunRecords:
    """The records of a place; one is read again only where its file has changed.

    Args:
        place: where the files are, for people.
        read: the content of a file; ``None`` where it is gone by now.
    """

    def __init__(self, place: str, read: Callable[[str], bytes | None]) -> None:
        self._place = place
        self._read = read
        self._known: dict[str, tuple[object, KnownRun]] = {}

    def of(self, files: Mapping[str, object]) -> list[KnownRun]:
        """The runs of files, each given with what changes when it does.

        Raises InputError for a record that cannot be read: what its run needs is not known.
        """
        known: dict[str, tuple[object, KnownRun]] = {}
        for name, stamp in sorted(files.items()):
            held = self._known.get(name)
            if held is None or held[0] != stamp:
                content = self._read(name)
                if content is None:
                    continue
                held = stamp, self._parsed(name, content)
            known[name] = held
        self._known = known
        return [run for _, run in known.values()]

    def _parsed(self, name: str, content: bytes) -> KnownRun:
        run = KnownRun.read(content)
        if run is None:
            raise _unreadable(f"{self._place}/{name}")
        return run


def is_record(name: str) -> bool:
    """Whether a file below ``runs/`` is a record, and none that is just being written."""
    last = name.rpartition("/")[2]
    return last.endswith(".json") and not last.startswith(".")


class UseLog:
    """What one run uses, written down as it goes on.

    Args:
        run: whose uses they are.
        earlier: what an earlier try in the same folder has written down; kept until the end, as
            the run may die again before it is where that try was.
        write: puts a run into the store.
    """

    def __init__(
        self, run: KnownRun, earlier: KnownRun | None, write: Callable[[KnownRun], None]
    ) -> None:
        self._run = run
        self._earlier = earlier.artifacts if earlier else ()
        self._used: list[str] = []
        self._write = write
        write(run.using(self._earlier))

    def note(self, name: str) -> None:
        """The artifact ``<stage>/<key>`` is about to be opened or computed."""
        if name not in self._used:
            self._used.append(name)
            if name not in self._earlier:
                self._write(self._run.using((*self._earlier, *self._used)))

    def close(self) -> None:
        """The run is finished: it needs what it has used, and nothing of earlier tries."""
        self._write(self._run.using(self._used))


def runs_below(folders: Iterable[Path], machine: str) -> list[KnownRun]:
    """The runs whose folders lie anywhere below the given ones, from what they left there.

    Raises InputError for a record that cannot be read.
    """
    found = []
    for file in (file for folder in folders for file in sorted(folder.rglob(RUN))):
        try:
            record = RunRecord.model_validate_json(file.read_bytes())
        except (OSError, ValidationError) as error:
            raise _unreadable(str(file)) from error
        used = tuple(f"{stage.name}/{stage.key}" for stage in record.stages)
        found.append(KnownRun.here(file.parent, machine).using(used))
    return found


def _unreadable(file: str) -> InputError:
    return InputError(
        "Of every run a record that can be read, to know what is needed",
        file,
        "Use the version of mocoflow that wrote it; or remove the file, if its run is of no use "
        "any more.",
    )
