"""A PostgreSQL of the site's own: loopback only, with a password, never run as root."""

from __future__ import annotations

import os
import pwd
import secrets
import shutil
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.production.site import MARK, Site
from mocoflow_core.errors import InputError

ROLE = "prefect"
# What the database is told of the environment of who starts it, who may be another user.
TOLD = ("PATH", "LD_LIBRARY_PATH", "TZ")
# Where packages put the programs that are not in PATH.
PLACES = (
    "/usr/lib/postgresql/*/bin",
    "/usr/pgsql-*/bin",
    "/opt/homebrew/opt/postgresql*/bin",
    "/usr/local/opt/postgresql*/bin",
    "/usr/local/pgsql/bin",
)
INSTALL = (
    "Install it (Debian: apt install postgresql; Fedora: dnf install postgresql-server "
    "postgresql-contrib; macOS: brew install postgresql), or do without: make up."
)


@dataclass(frozen=True)
class PostgreSQL:
    """One cluster below the site's folder."""

    site: Site

    @property
    def home(self) -> Path:
        return self.site.folder / "postgresql"

    @property
    def data(self) -> Path:
        return self.home / "data"

    @property
    def log(self) -> Path:
        return self.site.logs / "database.log"

    @property
    def url(self) -> str:
        """As Prefect's server connects to the running database."""
        password = (self.home / "password").read_text()
        return f"postgresql+asyncpg://{ROLE}:{password}@127.0.0.1:{self._port()}/postgres"

    def start(self) -> str:
        """Start it, make it before where it is not there yet; give its address.

        Raises InputError where the programs or a user to run them are missing.
        """
        programs = find_programs(self._version())
        if not (self.data / "PG_VERSION").is_file():
            self._make(programs)
        if not self.is_running():
            self.log.touch(mode=0o600)
            self._give_away(self.log)
            options = (
                f"-p {_free_port()} -c listen_addresses=127.0.0.1 -c unix_socket_directories=''"
            )
            words = ["-w", "-t", "60", "-l", str(self.log), "-o", options, "start"]
            self._run(programs / "pg_ctl", "-D", str(self.data), *words)
        return self.url

    def is_running(self) -> bool:
        if not (self.data / "postmaster.pid").is_file():
            return False
        status = [str(find_programs(self._version()) / "pg_ctl"), "-D", str(self.data), "status"]
        done = subprocess.run(status, capture_output=True, env=_environment(), **_user())
        return done.returncode == 0

    def stop(self) -> bool:
        """Stop it; tell whether it was running."""
        if not self.is_running():
            return False
        programs = find_programs(self._version())
        self._run(programs / "pg_ctl", "-D", str(self.data), "-w", "-m", "fast", "stop")
        return True

    def _make(self, programs: Path) -> None:
        self._own(self.home)
        password = self.home / "password"
        password.touch(mode=0o600)
        password.write_text(secrets.token_urlsafe(24))
        self._give_away(password)
        words = [f"--pwfile={password}", "--auth=scram-sha-256", "-E", "UTF8", "--locale=C"]
        self._run(programs / "initdb", "-D", str(self.data), "-U", ROLE, *words)

    def _own(self, folder: Path) -> None:
        """Make a folder of the database's user, who must be able to reach it."""
        folder.mkdir(mode=0o700, exist_ok=True)
        self._give_away(folder)
        if subprocess.run(["test", "-w", folder], env=_environment(), **_user()).returncode != 0:
            raise InputError(
                f"PostgreSQL's folder must be reachable for the user {_user()['user']}, as which "
                "it runs in place of root",
                str(folder),
                "Choose a state folder that is not below a private one: make up STATE=DIR.",
            )

    def _give_away(self, path: Path) -> None:
        if user := _user().get("user"):
            shutil.chown(path, user)

    def _run(self, program: Path, *words: str) -> None:
        # Its output goes to a file: the database itself would keep a pipe open.
        with (self.site.logs / "postgresql.log").open("ab") as log:
            done = subprocess.run(
                [program, *words],
                cwd="/",
                env=_environment() | {MARK: str(self.site.folder)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                **_user(),
            )
        if done.returncode != 0:
            raise RuntimeError(f"{program.name} failed; {self.site.logs}/postgresql.log says why")

    def _port(self) -> int:
        """The fourth line of the file that a running database keeps."""
        return int((self.data / "postmaster.pid").read_text().splitlines()[3])

    def _version(self) -> str | None:
        """Of the programs that made the data; others cannot read it."""
        file = self.data / "PG_VERSION"
        return file.read_text().strip() if file.is_file() else None


def find_programs(version: str | None = None) -> Path:
    """The folder of initdb, pg_ctl and postgres: the newest, or those of a major version.

    Raises InputError, which says what to install, where there are none.
    """
    found = {_major(folder): folder for folder in _folders()}
    if version is not None:
        found = {major: folder for major, folder in found.items() if str(major) == version}
    if not found:
        raise InputError(
            f"PostgreSQL{f' {version}' if version else ''}'s initdb, pg_ctl and postgres",
            f"none in PATH and {', '.join(PLACES)}",
            INSTALL,
        )
    return found[max(found)]


def _folders() -> Iterator[Path]:
    in_path = shutil.which("initdb")
    places = [Path(in_path).resolve().parent] if in_path else []
    places += [folder for place in PLACES for folder in Path("/").glob(place[1:])]
    for folder in places:
        if all((folder / name).is_file() for name in ("initdb", "pg_ctl", "postgres")):
            yield folder


def _major(folder: Path) -> int:
    """15 of ``postgres (PostgreSQL) 15.14 (Debian 15.14-0+deb12u1)``."""
    words = [str(folder / "postgres"), "--version"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return int(said.partition(")")[2].split(".")[0])


def _user() -> dict[str, Any]:
    """Whom root runs the database as; everybody else runs it themselves."""
    if os.geteuid() != 0:
        return {}
    for name in ("postgres", "nobody"):
        try:
            entry = pwd.getpwnam(name)
        except KeyError:
            continue
        return {"user": name, "group": entry.pw_gid, "extra_groups": []}
    raise InputError("a user postgres or nobody, as PostgreSQL does not run as root", "none", "")


def _environment() -> dict[str, str]:
    """None of the passwords around it: the user that runs the database can read it."""
    return {name: os.environ[name] for name in TOLD if name in os.environ} | {"LC_ALL": "C"}


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
