"""Parameters of flows with their bounds; a server refuses what is out of them before a run is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from flows.bounds import HIGHEST_SEED, MONTH_S
from mocoflow_core.methods.ablations import SETTINGS
from mocoflow_core.methods.experiments import EXPERIMENTS
from mocoflow_core.methods.scoring import METHODS
from mocoflow_core.metrics.curve import CURVE_METRICS

Seed = Annotated[int, Field(ge=0, le=HIGHEST_SEED)]
Seeds = Annotated[int, Field(ge=1, le=100)]
Devices = Annotated[int, Field(ge=1, le=1024)]
Machines = Annotated[int, Field(ge=1, le=1024)]
Processes = Annotated[int, Field(ge=1, le=1024)]
Budget = Annotated[float, Field(gt=0.0, le=MONTH_S)]
Setting = Annotated[str, Field(pattern=r"^\s*\S+\s*=")]
Until = Annotated[str, Field(pattern=r"^\s*train_psnr\s*=")]
Method = Literal[tuple(dict.fromkeys((*SETTINGS, *METHODS)))]
ExperimentName = Literal[tuple(EXPERIMENTS)]
Target = Annotated[str, Field(pattern=rf"^\s*({'|'.join(CURVE_METRICS)})\s*=\s*\S+\s*$")]
# As Dask reads it: without a kind of connection it is tcp.
Scheduler = Annotated[str, Field(pattern=r"^([a-z]+://)?\S+:\d+$")]
Rendezvous = Annotated[str, Field(pattern=r"^.+:\d+$")]
Slots = Annotated[str, Field(min_length=1)]
