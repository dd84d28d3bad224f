"""The history of a benchmark in words: what has become worse, and what counts as worse."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.history import FEWEST_NIGHTS, LAST_NIGHTS, MARGINS, Regression
from mocoflow_core.report.metric_labels import label_of
from mocoflow_core.report.omissions import Omission


def in_words(regressions: Sequence[Regression]) -> list[Omission]:
    """What is worse and by how much; what a contender has no numbers of any more, together."""
    worse = [_worse(found) for found in regressions if not math.isnan(found.value)]
    gone: dict[Contender, list[Regression]] = {}
    for found in regressions:
        if math.isnan(found.value):
            gone.setdefault(found.contender, []).append(found)
    return worse + [_gone(contender, found) for contender, found in gone.items()]


def _worse(found: Regression) -> Omission:
    label = label_of(found.measure)
    loss = label.with_unit(abs(found.value - found.usual))
    margin = label.with_unit(MARGINS[found.measure].at(found.usual))
    return Omission(
        f"{'/'.join(found.contender)}: {label.title}",
        f"{label.with_unit(found.value)}, which is {loss} worse than "
        f"{label.with_unit(found.usual)}, the median of the last {found.nights} nights "
        f"(flagged above {margin})",
    )


def _gone(contender: Contender, found: Sequence[Regression]) -> Omission:
    usual = [
        f"{label_of(one.measure).title} (usually {label_of(one.measure).with_unit(one.usual)})"
        for one in found
    ]
    return Omission("/".join(contender), f"no number any more: {', '.join(usual)}")


def margins_in_words() -> str:
    """When a number is flagged."""
    parts = []
    for measure, margin in MARGINS.items():
        label = label_of(measure)
        least = f"{margin.absolute:g} {label.unit}".rstrip()
        share = f"{margin.relative:.0%}, at least " if margin.relative else ""
        parts.append(f"{label.title} {share}{least}")
    return (
        f"Flagged is what is worse than the median of the last {LAST_NIGHTS} nights by more than: "
        f"{'; '.join(parts)}. With fewer than {FEWEST_NIGHTS} nights nothing is. Seconds are "
        "compared with nights on the same machine."
    )
