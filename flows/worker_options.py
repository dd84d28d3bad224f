"""Options that say what runs and the cells of a benchmark run on."""

from __future__ import annotations

import typer

CellWorkers = typer.Option(help="Processes that run cells at once, with their share of the cores.")
DaskAddress = typer.Option(
    metavar="ADDRESS", help="Scheduler of a Dask cluster that runs the cells: tcp://HOST:8786."
)
SlotsOfServer = typer.Option(
    metavar="NAME",
    help="Global concurrency limit of the Prefect server that the run holds one slot of.",
)
Slots = typer.Option(
    metavar="NAME",
    help="What a running cell holds one of: a resource of the Dask workers, else a global "
    "concurrency limit of the Prefect server.",
)
