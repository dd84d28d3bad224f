"""A PostgreSQL of the tests' own, on loopback, that can be stopped and started again."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.free_port import free_port

PROGRAMS = Path("/usr/lib/postgresql/15/bin")


@dataclass(frozen=True)
class Database:
    folder: Path
    port: int
    owner: pwd.struct_passwd

    @property
    def url(self) -> str:
        return f"postgresql+asyncpg://prefect@127.0.0.1:{self.port}/prefect"

    def start(self) -> None:
        options = f"-p {self.port} -c listen_addresses=127.0.0.1 -k {self.folder}"
        log = str(self.folder / "log")
        self.run("pg_ctl", "-D", self.data, "-o", options, "-l", log, "-w", "-t", "120", "start")

    def stop(self) -> None:
        """At once, as a crash would: it recovers from its log at the next start."""
        self.run("pg_ctl", "-D", self.data, "-m", "immediate", "-w", "stop")

    @property
    def data(self) -> str:
        return str(self.folder / "data")

    def run(self, program: str, *words: str) -> None:
        """PostgreSQL refuses to run as root."""
        subprocess.run(
            [str(PROGRAMS / program), *words],
            check=True,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            user=self.owner.pw_uid,
            group=self.owner.pw_gid,
            timeout=180.0,
        )


def missing() -> str:
    """Why there can be no database here; empty where there can."""
    if not PROGRAMS.is_dir():
        return f"no PostgreSQL in {PROGRAMS}"
    if os.geteuid() == 0 and not any(user.pw_name == "postgres" for user in pwd.getpwall()):
        return "PostgreSQL does not run as root, and there is no user postgres"
    return ""


@contextmanager
def database(folder: Path) -> Iterator[Database]:
    """A new one, below a folder that its owner can reach, for as long as the block lasts."""
    owner = pwd.getpwnam("postgres") if os.geteuid() == 0 else pwd.getpwuid(os.geteuid())
    folder.mkdir()
    shutil.chown(folder, owner.pw_uid, owner.pw_gid)
    made = Database(folder, free_port(), owner)
    made.run("initdb", "-D", made.data, "-U", "prefect", "--auth=trust", "-E", "UTF8")
    made.start()
    try:
        at = ("-h", "127.0.0.1", "-p", str(made.port), "-U", "prefect")
        made.run("createdb", *at, "prefect")
        yield made
    finally:
        made.stop()
