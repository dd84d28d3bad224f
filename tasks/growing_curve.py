"""The error of a run while it goes on: a table on Prefect's page that grows."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

from prefect.artifacts import create_markdown_artifact
from prefect.client.orchestration import get_client
from prefect.client.schemas.actions import ArtifactUpdate
from prefect.context import TaskRunContext

from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.snapshots import Snapshot
from tasks.server import if_the_server_answers

KEY = "train-psnr"


class GrowingCurve:
    """One artifact for a run, written anew with each point.

    Args:
        before: training clock when the optimisation started.
    """

    def __init__(self, before: Seconds) -> None:
        self._before = before
        self._id: UUID | None = None

    def show(self, curve: Sequence[Snapshot]) -> None:
        """Put all points so far on the page; outside of a task there is none."""
        if not TaskRunContext.get():
            return
        with if_the_server_answers():
            self._write("\n".join(_rows(curve, self._before)))

    def _write(self, text: str) -> None:
        if self._id is None:
            created = create_markdown_artifact(
                text, key=KEY, description="PSNR of pixels that are not trained on, as it grows"
            )
            self._id = created if isinstance(created, UUID) else None
        else:
            client = get_client(sync_client=True)
            client.update_artifact(self._id, ArtifactUpdate(data=text))


def _rows(curve: Sequence[Snapshot], before: Seconds) -> list[str]:
    rows = ["| training clock, s | CPU seconds | step | train PSNR, dB |", "|-:|-:|-:|-:|"]
    for point in curve:
        clock = before + Seconds(point.wall_s, point.cpu_s)
        score = "" if point.train_psnr is None else f"{point.train_psnr:.2f}"
        rows.append(f"| {clock.wall:.1f} | {clock.cpu:.1f} | {point.step} | {score} |")
    return rows
