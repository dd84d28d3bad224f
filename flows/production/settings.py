"""What a site was told by the environment of ``up``, kept for the times when it says nothing."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path

from flows.allowed_addresses import CLUSTER_ADDRESSES
from flows.allowed_folders import DATA_ROOTS, RESULTS_ROOT, STORE
from flows.data_set_roots import ROOTS
from mocoflow_core.errors import InputError

# The notification block through which people are told of bad nights.
BLOCK = "MOCOFLOW_NOTIFICATION_BLOCK"
# What a worker's runs are told about folders and stores.
WORKER_VARIABLES = (DATA_ROOTS, RESULTS_ROOT, STORE, *ROOTS.values())
# What a running worker cannot be told any more.
FIXED = (*WORKER_VARIABLES, CLUSTER_ADDRESSES)
KEPT = (*FIXED, BLOCK)
FILE = "settings.json"


def told(folder: Path) -> dict[str, str]:
    """The environment's variables, and those of the last ``up`` that it does not name.

    An empty variable takes back what was told before.
    """
    before = kept(folder)
    now = {name: _whole(name) if name in os.environ else before.get(name, "") for name in KEPT}
    return {name: value for name, value in now.items() if value}


def kept(folder: Path) -> dict[str, str]:
    """What ``keep`` has kept in a site's folder. Raises InputError for a file that is not its."""
    file = folder / FILE
    try:
        found = json.loads(file.read_text())
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise _unreadable(file, error) from error
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise _unreadable(file, "no names with texts")
    return found


def keep(folder: Path, settings: dict[str, str]) -> None:
    """For their owner alone: a store's address may have a password in it."""
    # A new file, and never what a link of that name leads to.
    descriptor, beside = tempfile.mkstemp(dir=folder, prefix=f".{FILE}.")
    try:
        with os.fdopen(descriptor, "w") as file:
            file.write(json.dumps(settings) + "\n")
        Path(beside).replace(folder / FILE)
    finally:
        Path(beside).unlink(missing_ok=True)


def _unreadable(file: Path, found: object) -> InputError:
    return InputError(
        f"{file} must be what the site was told, as mocoflow has written it",
        str(found),
        "Remove it, and say everything again with `make up`.",
    )


def _whole(name: str) -> str:
    """A variable of the environment with whole paths: working directories differ."""
    value = os.environ[name]
    if name not in WORKER_VARIABLES or (name == STORE and ("://" in value or "::" in value)):
        return value
    paths = value.split(os.pathsep) if name == DATA_ROOTS else [value]
    return os.pathsep.join(str(Path(path).absolute()) for path in paths if path)
