"""The runs that a store knows of, and which of its artifacts they need.

A run writes itself down under ``runs/`` of its store when it takes its folder, and adds every
artifact as it uses it. Who collects garbage keeps what the runs need whose folders are still there.
"""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Callable, Iterable
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from mocoflow_core.io.run_folder import RUN, RunRecord

RUNS = "runs"  # beside the folders of the stages


class KnownRun(BaseModel):
    """One run: its folder, the machine that the folder is on, the artifacts that it has used."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    folder: str
    host: str
    artifacts: tuple[str, ...] = ()  # as "<stage>/<key>"

    @classmethod
    def here(cls, folder: Path) -> KnownRun:
        return cls(folder=str(folder.resolve()), host=socket.gethostname())

    @classmethod
    def read(cls, content: bytes | None) -> KnownRun | None:
        try:
            return None if content is None else cls.model_validate_json(content)
        except ValidationError:
            return None

    @property
    def file(self) -> str:
        """Its name in the store: a folder's next run takes the place of its last one."""
        name = hashlib.sha256(f"{self.host}\0{self.folder}".encode()).hexdigest()[:16]
        return f"{RUNS}/{name}.json"

    def content(self) -> bytes:
        return (self.model_dump_json(indent=1) + "\n").encode()

    def using(self, artifacts: Iterable[str]) -> KnownRun:
        return self.model_copy(update={"artifacts": tuple(dict.fromkeys(artifacts))})

    def is_kept(self) -> bool:
        """Whether its folder is still there; nobody here can say that another machine's is not."""
        return (Path(self.folder) / RUN).is_file() or self.host != socket.gethostname()


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


def runs_below(folders: Iterable[Path]) -> list[KnownRun]:
    """The runs whose folders lie anywhere below the given ones, from what they left there."""
    found = []
    for file in (file for folder in folders for file in sorted(folder.rglob(RUN))):
        try:
            record = RunRecord.model_validate_json(file.read_bytes())
        except (OSError, ValidationError):
            continue
        used = tuple(f"{stage.name}/{stage.key}" for stage in record.stages)
        found.append(KnownRun.here(file.parent).model_copy(update={"artifacts": used}))
    return found
