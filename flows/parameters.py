"""Parameters of flows with their bounds; a server refuses what is out of them before a run is."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flows.bounds import HIGHEST_SEED, MONTH_S

Seed = Annotated[int, Field(ge=0, le=HIGHEST_SEED)]
Seeds = Annotated[int, Field(ge=1, le=100)]
Devices = Annotated[int, Field(ge=1, le=1024)]
Machines = Annotated[int, Field(ge=1, le=1024)]
Budget = Annotated[float, Field(gt=0.0, le=MONTH_S)]
Setting = Annotated[str, Field(pattern=r"^\s*\S+\s*=")]
Until = Annotated[str, Field(pattern=r"^\s*train_psnr\s*=")]
