"""All that a benchmark has found, as its page and its tables show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.methods.experiments import USUAL, Experiment
from mocoflow_core.methods.past_benchmarks import night_rows
from mocoflow_core.metrics.benchmark_tables import Runs
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.history import NOW, HistoryRow, Regression, regressions
from mocoflow_core.metrics.misalignment import MisalignmentRow
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import TimeToTarget
from mocoflow_core.report.omissions import Omission, omissions
from mocoflow_core.report.seed_summary import Summaries, summarise


@dataclass(frozen=True)
class BenchmarkResults:
    """All that a benchmark's tables hold."""

    cells: Sequence[CellRecord]
    scores: Runs[ScoreRow]
    curves: Runs[CurveRow]
    times: Sequence[TimeToTarget]
    misplaced: Sequence[MisalignmentRow] = ()
    unread: Sequence[Omission] = ()  # what could not be begun
    past: Sequence[HistoryRow] = ()  # earlier nights
    experiment: Experiment = USUAL

    def summaries(self) -> Summaries:
        """Mean and range over seeds by contender and metric."""
        cameras = {cell.scene: cell.train_camera for cell in self.cells if cell.train_camera}
        return summarise(self.scores, cameras)

    def omissions(self) -> list[Omission]:
        """What is missing, or compares nothing."""
        return [*self.unread, *omissions(self.cells, self.scores, self.times)]

    def tonight(self) -> list[HistoryRow]:
        """This night's numbers, as later ones will read them."""
        return night_rows(NOW, self.cells, self.summary_records())

    def regressions(self) -> list[Regression]:
        """What is worse than it usually was."""
        return regressions(self.tonight(), self.past)

    def summary_records(self) -> list[dict[str, Any]]:
        """The summaries as plain values, for ``benchmark.json``."""
        return [
            {**contender._asdict(), "metric": metric, **summary._asdict()}
            for contender, summaries in self.summaries().items()
            for metric, summary in summaries.items()
        ]
