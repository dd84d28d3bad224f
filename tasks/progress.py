"""How far a stage is: a bar in a terminal, an artifact in Prefect."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from uuid import UUID

from prefect.artifacts import create_progress_artifact, update_progress_artifact
from prefect.context import FlowRunContext, TaskRunContext

from mocoflow_core.progress import Progress
from mocoflow_core.report.markdown_text import plain
from tasks.cancellation import end_if_cancelled
from tasks.server import if_the_server_answers
from tasks.terminal_bar import terminal_bar

# Each update is an event that Prefect keeps for days.
SECONDS_BETWEEN_UPDATES = 5.0


@contextmanager
def showing_progress(
    stage: str, note_time: Callable[[], None] = lambda: None
) -> Iterator[Progress]:
    """A callback (fraction in [0, 1], short text) for the body of a stage, or of a run's import.

    ``note_time`` is called now and then, so that a killed stage knows what it has cost. Raises
    RunCancelled out of a stage's callback when somebody has cancelled its flow run.
    """
    shown = TaskRunContext.get() or FlowRunContext.get()
    artifact = ProgressArtifact(stage) if shown else None
    updated = time.monotonic()
    with terminal_bar(stage) as show:

        def report(fraction: float, text: str) -> None:
            nonlocal updated
            show(fraction, text)
            if time.monotonic() - updated >= SECONDS_BETWEEN_UPDATES:
                updated = time.monotonic()
                note_time()
                if artifact:
                    with if_the_server_answers():
                        artifact.update(fraction, text)
                    end_if_cancelled()

        yield report


class ProgressArtifact:
    """A progress artifact that appears with its first update: short stages leave none."""

    def __init__(self, stage: str) -> None:
        self._stage = stage
        self._id: UUID | None = None

    def update(self, fraction: float, text: str) -> None:
        percent = 100.0 * min(max(fraction, 0.0), 1.0)
        description = f"{self._stage}: {plain(text)}"
        if self._id is None:
            key = self._stage.replace("_", "-")
            created = create_progress_artifact(percent, key=key, description=description)
            self._id = created if isinstance(created, UUID) else None
        else:
            update_progress_artifact(self._id, percent, description=description)
