"""What a benchmark's tables do not show: cells that did not finish, and comparisons of nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from mocoflow_core.methods.ablations import change_of, compared_with
from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.metrics.benchmark_tables import Contender, Runs
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import TimeToTarget
from mocoflow_core.report.metric_labels import label_of


class Omission(NamedTuple):
    """What is missing or must not be trusted, and why."""

    what: str
    why: str


def omissions(
    cells: Iterable[CellRecord], scores: Runs[ScoreRow], times: Sequence[TimeToTarget]
) -> list[Omission]:
    """Failed cells first, then refused steps, ablations without effect, targets out of reach."""
    cells = list(cells)
    found = _unfinished(cells)
    found += [Omission(c.name, f"guard: {event}") for c in cells for event in c.guard_events]
    found += [Omission("/".join(c), _same(c)) for c in scores if _changed_nothing(c, scores)]
    return found + _never_reached(times)


def _unfinished(cells: Iterable[CellRecord]) -> list[Omission]:
    """Seeds of one contender that ended in the same way are said once."""
    ended: dict[tuple[str, str], list[str]] = {}
    for cell in cells:
        if cell.state != "finished":
            contender = f"{cell.scene}/{cell.preset}/{cell.method}"
            ended.setdefault((contender, f"{cell.state}: {cell.reason}"), []).append(str(cell.seed))
    return [
        Omission(f"{contender}, seed {', '.join(seeds)}", why)
        for (contender, why), seeds in ended.items()
    ]


def _changed_nothing(contender: Contender, scores: Runs[ScoreRow]) -> bool:
    """Whether a method has the very scores of the one it differs from, in every seed."""
    other = compared_with(contender.method)
    if other is None:
        return False
    whole, ours = scores.get(contender._replace(method=other), {}), scores[contender]
    common = whole.keys() & ours.keys()
    if not common:
        return False
    return all(_numbers(ours[seed]) == _numbers(whole[seed]) for seed in common)


def _numbers(rows: Iterable[ScoreRow]) -> list[str]:
    """Every value in full; as text, for which NaN equals NaN."""
    return [repr(row._replace(method="")) for row in rows]


def _same(contender: Contender) -> str:
    other, change = compared_with(contender.method), change_of(contender.method)
    return f"the very scores of {other}: on this scene nothing comes of {change}"


def _never_reached(times: Sequence[TimeToTarget]) -> list[Omission]:
    """Per scene and metric: the targets that no seed of no contender reached."""
    reached: dict[tuple[str, str, float], int] = {}
    for row in times:
        target = (row.scene, row.metric, row.target)
        reached[target] = reached.get(target, 0) + row.reached
    missed: dict[tuple[str, str], list[str]] = {}
    for (scene, metric, value), count in reached.items():
        if not count:
            missed.setdefault((scene, metric), []).append(f"{value:g}")
    return [
        Omission(
            f"{label_of(metric).title} on {scene}",
            f"no seed of any method reached {', '.join(values)} {label_of(metric).unit}".rstrip(),
        )
        for (scene, metric), values in missed.items()
    ]
