"""Measuring the cases: every value of every sweep, on one thread and from the same random state."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch

from mocoflow_core.stability.case import Case, Found
from mocoflow_core.stability.table import StabilityRow
from mocoflow_core.threads import torch_threads


def measure_cases(
    area: str,
    cases: tuple[Case[Any], ...],
    progress: Callable[[float, str], None] = lambda fraction, text: None,
) -> list[StabilityRow]:
    """Rows of all cases of an area. A case that raises has failed; the others go on."""
    rows: list[StabilityRow] = []
    for done, case in enumerate(cases):
        progress(done / len(cases), case.name.replace("_", " "))
        rows += measure_case(area, case)
    return rows


def measure_case(area: str, case: Case[Any]) -> Iterator[StabilityRow]:
    """One row for each value of the sweep."""
    for value in case.values:
        start = time.perf_counter()
        with torch_threads(1), torch.random.fork_rng():
            torch.manual_seed(0)
            found = _measured(case, value)
        bound = case.bound_at(value)
        yield StabilityRow(
            area=area,
            case=case.name,
            parameter=case.parameter,
            value=value if isinstance(value, str) else f"{value:.9g}",
            number=None if isinstance(value, str) else float(value),
            error=found.error,
            bound=bound,
            unit=case.unit,
            finite=found.is_finite,
            passed=found.is_finite and bool(found.error <= bound),
            remark=found.remark,
            seconds=time.perf_counter() - start,
        )


def _measured(case: Case[Any], value: Any) -> Found:  # noqa: ANN401 - a number or a word
    try:
        with np.errstate(all="ignore"):
            return case.measure(value)
    except Exception as error:
        words = " ".join(str(error).split())
        return Found(np.nan, remark=f"{type(error).__name__}: {words:.300}")
