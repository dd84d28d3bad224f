"""One machine's production: which folder, port and database it has, and what its processes see."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from urllib.parse import urlsplit

from flows.allowed_folders import DATA_ROOTS, RESULTS_ROOT
from flows.production.settings import KEPT, told
from flows.user_folders import data_folder, results_folder
from mocoflow_core.errors import InputError


class Database(StrEnum):
    """What the server keeps runs, logs and artifacts in."""

    SQLITE = "sqlite"
    POSTGRESQL = "postgresql"


# All that a site starts has it in its environment, by which it is found again.
MARK = "MOCOFLOW_SITE"
PREFECT = (sys.executable, "-m", "prefect")
AUTHENTICATION = "PREFECT_SERVER_API_AUTH_STRING"
# Slots that a run holds outlive the server: in its memory they would be lost, and stay taken.
LEASES = "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE"
LEASES_IN_FILES = "prefect.server.concurrency.lease_storage.filesystem"


def default_folder() -> Path:
    """Where a site keeps its state (``XDG_STATE_HOME``); a place of its own for root.

    PostgreSQL does not run as root, and whom it runs as may not look into root's home.
    """
    if os.geteuid() == 0:
        return Path("/var/lib/mocoflow")
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "mocoflow"


@dataclass(frozen=True)
class Site:
    """A server, its database and one worker on this machine; nothing listens beyond loopback."""

    folder: Path
    port: int = 4200
    database: Database = Database.SQLITE

    @property
    def pages(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def api(self) -> str:
        return f"{self.pages}/api"

    def is_at(self, address: str) -> bool:
        """Whether an address of an API is this one's, however it is spelt."""
        asked, ours = urlsplit(address.rstrip("/")), urlsplit(self.api)
        here = asked.hostname in ("localhost", "127.0.0.1", "::1")
        return here and (asked.port, asked.path) == (ours.port, ours.path)

    @property
    def logs(self) -> Path:
        return self.folder / "logs"

    def pid_file(self, name: str) -> Path:
        return self.folder / f"{name}.pid"

    def environment(self, database_url: str | None = None) -> dict[str, str]:
        """Of the site's processes: the user's own, with the site's settings, also of earlier times.

        Runs are confined to folders: the user's, or else those that mocoflow has among their data.
        An empty variable takes back what was told, and a relative path lies below the working
        directory.
        """
        chosen = {
            MARK: str(self.folder),
            "PREFECT_HOME": str(self.folder / "prefect"),
            "PREFECT_API_URL": self.api,
            "PREFECT_UI_URL": self.pages,
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
            # The second version of the pages asks hosts elsewhere.
            "PREFECT_SERVER_UI_V2_ENABLED": "false",
            "DO_NOT_TRACK": "1",
            "PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30",
            "NO_COLOR": "1",
            LEASES: LEASES_IN_FILES,
        }
        if secret := os.environ.get(AUTHENTICATION):
            chosen |= {AUTHENTICATION: secret, "PREFECT_API_AUTH_STRING": secret}
        if database_url:
            chosen["PREFECT_SERVER_DATABASE_CONNECTION_URL"] = database_url
        roots = {DATA_ROOTS: str(data_folder()), RESULTS_ROOT: str(results_folder())}
        chosen |= roots | told(self.folder)
        ours = (AUTHENTICATION, *KEPT)
        return {name: v for name, v in os.environ.items() if name not in ours} | chosen

    def save(self) -> None:
        document = {"port": self.port, "database": self.database}
        (self.folder / "site.json").write_text(json.dumps(document) + "\n")

    @classmethod
    def of_folder(cls, folder: Path) -> Site | None:
        """The site that was last started in a folder, if one ever was."""
        try:
            document = json.loads((folder / "site.json").read_text())
        except OSError:
            return None
        return cls(folder, document["port"], Database(document["database"]))

    @classmethod
    def asked_for(
        cls, folder: Path, port: int | None = None, database: Database | None = None
    ) -> Site:
        """The site of a folder, where nothing else is asked for; a new one has the defaults.

        Raises InputError for another database than the one that has kept the site's runs.
        """
        before = cls.of_folder(folder)
        if before and database and database != before.database:
            raise InputError(
                f"{before.database}, in which the site in {folder} keeps its runs",
                str(database),
                "Leave DB out, or begin another site: make up STATE=DIR.",
            )
        site = before or cls(folder)
        return replace(site, port=port or site.port, database=database or site.database)
