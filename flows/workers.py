"""What the cells of a benchmark run on: this process, several, or those of a Dask cluster."""

from __future__ import annotations

import os
import re
from importlib.util import find_spec

from pydantic import BaseModel, ConfigDict

from flows.allowed_addresses import require_allowed_address
from mocoflow_core.errors import InputError


class Workers(BaseModel):
    """One cell at a time here; or so many processes here; or whatever a Dask cluster has."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    count: int = 1
    dask: str | None = None  # address of a scheduler
    slots: str | None = None  # what a running cell holds one of

    def check(self) -> None:
        """Raise InputError for what can be known to fail before anything is loaded or asked."""
        cores = len(os.sched_getaffinity(0))
        if not 1 <= self.count <= cores:
            raise InputError(
                f"--workers must be 1 to {cores}, the cores that this process may use",
                str(self.count),
                "Ask for fewer.",
            )
        if self.dask is None:
            return
        if self.count > 1:
            raise InputError(
                "A benchmark runs on --workers here or on a --dask cluster",
                f"--workers {self.count} --dask {self.dask}",
                "Leave one out; the cluster has its own workers.",
            )
        if not re.search(r":\d+$", self.dask):
            raise InputError(
                "--dask must be an address with its port", repr(self.dask), "As tcp://HOST:8786."
            )
        require_allowed_address(self.dask, "dask")
        if find_spec("prefect_dask") is None:
            raise InputError(
                "--dask needs prefect-dask",
                "an installation without it",
                "pip install 'mocoflow[dask]', here and where the workers are.",
            )

    @property
    def words(self) -> list[str]:
        """As they stand on the command line."""
        words = ["--workers", str(self.count)] if self.count > 1 else []
        words += ["--dask", self.dask] if self.dask else []
        return [*words, *(["--slots", self.slots] if self.slots else [])]
