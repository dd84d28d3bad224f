"""Where a worker lets its runs read and write: whoever may start a run may not read every file.

On a command line, where none of these variables is set, every path is as it was given.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from flows.data_set_roots import configured_roots
from flows.user_folders import body_models_folder, cache_folder
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.named_files import named_files, require_networks

DATA_ROOTS = "MOCOFLOW_DATA_ROOTS"
RESULTS_ROOT = "MOCOFLOW_RESULTS_ROOT"
STORE = "MOCOFLOW_STORE"


@dataclass(frozen=True)
class AllowedFolders:
    """Resolved folders: links and ``..`` in a path are followed before it is compared."""

    data: tuple[Path, ...] = ()  # none: anything may be read
    results: Path | None = None  # none: anything may be written
    store: str | None = None  # the address that runs use where they name none

    @classmethod
    def of_environment(cls) -> AllowedFolders:
        """What the process is told. The roots of data sets count where data roots are set."""
        given = tuple(filter(None, os.environ.get(DATA_ROOTS, "").split(os.pathsep)))
        roots = [Path(root) for root in given]
        roots += configured_roots().values() if given else ()
        results = os.environ.get(RESULTS_ROOT)
        return cls(
            data=tuple(root.resolve() for root in roots),
            results=Path(results).resolve() if results else None,
            store=os.environ.get(STORE) or None,
        )

    @property
    def confine(self) -> bool:
        """Whether runs may not do everything: others than whoever set this up may start them."""
        return bool(self.data) or self.results is not None

    def to_read(self, path: Path, parameter: str) -> Path:
        """The path itself, resolved where roots are set; a relative one lies below one of these.

        Raises InputError for a path that leaves the roots.
        """
        if not self.data:
            return path
        places = [(root / path).resolve() for root in self.data]
        allowed = [place for place in places if _below(place, self._readable())]
        if not allowed:
            raise _outside(parameter, path, self.data, DATA_ROOTS)
        return next((place for place in allowed if place.exists()), allowed[0])

    def to_write(self, path: Path, parameter: str) -> Path:
        """The path itself, resolved where a root is set; a relative one lies below it.

        Raises InputError for a path that leaves the root.
        """
        if self.results is None:
            return path
        place = (self.results / path).resolve()
        if not _below(place, [self.results]):
            raise _outside(parameter, path, (self.results,), RESULTS_ROOT)
        return place

    def to_keep(self, address: str | None) -> str | None:
        """The store's address: what was asked for, else what the worker is told.

        Raises InputError for a folder outside of the results, and for an address elsewhere than
        the worker's own store.
        """
        if address is None or self.results is None or address == self.store:
            return address or self.store
        if "://" in address or "::" in address:
            raise InputError(
                f"store must be a folder below {self.results} ({RESULTS_ROOT}) or the worker's "
                f"own ({STORE})",
                repr(address),
                "Leave it out.",
            )
        return str(self.to_write(Path(address), "store"))

    def check_files(self, part: ConfigurationPart) -> None:
        """Before anything looks at the files that a configuration names.

        Raises InputError for one outside of the data roots, whether there is any or not, and for
        a network's file that is not there.
        """
        for name, path in named_files(part) if self.data else ():
            if not _below(path.resolve(), self._readable()):
                raise _outside(name, path, self.data, DATA_ROOTS)
        require_networks(part)

    def _readable(self) -> list[Path]:
        """The data, what was made of them, the user's body models, and earlier results."""
        made = [cache_folder() / "scenes", cache_folder() / "datasets", body_models_folder()]
        results = [self.results] if self.results else []
        return [*self.data, *(folder.resolve() for folder in made), *results]


def _below(place: Path, roots: list[Path]) -> bool:
    return any(place.is_relative_to(root) for root in roots)


def _outside(parameter: str, path: Path, roots: tuple[Path, ...], variable: str) -> InputError:
    named = ", ".join(map(str, roots))
    return InputError(
        f"{parameter} must lie below {named}",
        str(path),
        f"Choose a path there, or set {variable} of the worker.",
    )
