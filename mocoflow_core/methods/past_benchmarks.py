"""What the same benchmark found in earlier nights, from the records in the folders around it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import Any

from mocoflow_core.io.machine import described
from mocoflow_core.methods.benchmark_folder import (
    RECORD,
    BenchmarkRecord,
    CellRecord,
    read_benchmark,
)
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.history import SECONDS, HistoryRow

# Nights that are shown; more are read by nobody.
SHOWN_NIGHTS = 60
# Of a machine's description.
DECIDES_SPEED = ("model", "cores", "threads", "devices")


def past_nights(own: Path, begun: BenchmarkRecord) -> list[str]:
    """Names of the folders beside ``own`` with finished benchmarks that asked the same, in order.

    Those that were finished later than ``begun`` once was, where it was, are left out: what a
    night is compared with does not change afterwards.
    """
    own = own.resolve()
    before = begun.finished_at or "~"  # Behind every moment.
    found = []
    for folder in (file.parent for file in own.parent.glob(f"*/{RECORD}") if file.parent != own):
        record = read_benchmark(folder)
        if record and record.finished and record.question == begun.question != "":
            found.append((record.finished_at, folder.name))
    return [name for moment, name in sorted(found) if "" < moment < before][-SHOWN_NIGHTS:]


def read_nights(folder: Path, names: Iterable[str]) -> list[HistoryRow]:
    """The numbers of benchmarks in a folder, by the names of theirs."""
    records = filter(None, (read_benchmark(folder / name) for name in names))
    return [
        row
        for record in records
        for row in night_rows(record.finished_at, record.cells, record.summary)
    ]


def night_rows(
    night: str, cells: Iterable[CellRecord], summary: Iterable[Mapping[str, Any]]
) -> list[HistoryRow]:
    """The numbers of one night.

    Args:
        summary: means over seeds, as ``benchmark.json`` holds them.
    """
    trained: dict[Contender, list[CellRecord]] = {}
    for cell in cells:
        if cell.state == "finished":
            trained.setdefault(Contender(cell.scene, cell.preset, cell.method), []).append(cell)
    rows = [
        HistoryRow(
            *(night, "", str(entry["scene"]), str(entry["preset"]), str(entry["method"])),
            *(str(entry["metric"]), float(entry["mean"])),
        )
        for entry in summary
    ]
    for contender, seeds in trained.items():
        # What an earlier command trained says nothing of this night's speed.
        measured = [cell for cell in seeds if not cell.from_store]
        for name in SECONDS:
            spent = [s for cell in measured if (s := getattr(cell, name)) is not None]
            if spent:
                usual = float(median(spent))
                rows.append(HistoryRow(night, _machine(measured), *contender, name, usual))
    return rows


def _machine(cells: Iterable[CellRecord]) -> str:
    return "; ".join(sorted({described(cell.machine, DECIDES_SPEED) for cell in cells}))
