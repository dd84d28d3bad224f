"""A progress bar with the remaining time, in a terminal and nowhere else.

Worker processes leave the terminal to the process that started them.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from mocoflow_core.progress import Progress


@contextmanager
def terminal_bar(title: str) -> Iterator[Progress]:
    """A callback (fraction in [0, 1], short text) that moves the bar."""
    with Bar(
        TextColumn("{task.description:<18}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}", markup=False),
        console=Console(stderr=True),
        disable=not _may_draw(),
    ) as bar:
        row = bar.add_task(title, total=1.0, text="")
        yield lambda fraction, text: bar.update(row, completed=fraction, text=text)
        bar.update(row, completed=1.0, text="")


def terminal_line(text: str) -> None:
    """A line above the bars, in a terminal and nowhere else."""
    console = Console(stderr=True)
    if console.is_terminal and _may_draw():
        console.print(text, highlight=False, markup=False)


def _may_draw() -> bool:
    return sys.stderr.isatty() and multiprocessing.parent_process() is None
