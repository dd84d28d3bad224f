"""A progress bar with the remaining time, in a terminal and nowhere else."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

Progress = Callable[[float, str], None]


@contextmanager
def terminal_bar(title: str) -> Iterator[Progress]:
    """A callback (fraction in [0, 1], short text) that moves the bar."""
    with Bar(
        TextColumn("{task.description:<18}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
    ) as bar:
        row = bar.add_task(title, total=1.0, text="")
        yield lambda fraction, text: bar.update(row, completed=fraction, text=text)
        bar.update(row, completed=1.0, text="")


def terminal_line(text: str) -> None:
    """A line above the bars, in a terminal and nowhere else."""
    console = Console(stderr=True)
    if console.is_terminal:
        console.print(text, highlight=False, markup=False)
