"""What can go from a store: what no kept run needs, nobody computes and nobody used lately."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mocoflow_core.io.holdings import Held
from mocoflow_core.io.known_runs import KnownRun


@dataclass(frozen=True)
class Sentence:
    """What becomes of something that the store holds.

    Attributes:
        why: it stays; empty where it can go.
        spare: whether it lies beside a whole artifact, so that no run needs it.
    """

    held: Held
    why: str
    spare: bool = False

    @property
    def goes(self) -> bool:
        return not self.why


def users(runs: Iterable[KnownRun], machine: str) -> dict[str, list[str]]:
    """For each artifact the folders of the kept runs that need it, as seen from a machine."""
    needed: dict[str, list[str]] = {}
    for run in runs:
        for name in run.artifacts if run.is_kept(machine) else ():
            needed.setdefault(name, []).append(run.folder)
    return needed


def is_needed(sentence: Sentence, runs: Iterable[KnownRun], machine: str) -> bool:
    """Whether a kept run needs by now what was to go."""
    return not sentence.spare and any(
        sentence.held.name in run.artifacts and run.is_kept(machine) for run in runs
    )


def age_s(held: Held, now: float) -> float:
    """Seconds since it was used; none where a clock was put back in the meantime."""
    return max(now - held.used_at, 0.0)


def judge(
    held: Iterable[Held], needed: Mapping[str, list[str]], older_than_s: float, now: float
) -> list[Sentence]:
    """What goes, and why the rest stays.

    A killed try is needed as long as its artifact is needed and not there: it is resumed.
    """
    held = list(held)
    whole = {item.name for item in held if not item.leftover and item.fault is None}

    def is_spare(item: Held) -> bool:
        return item.leftover and item.name in whole

    def why(item: Held) -> str:
        if item.busy:
            return "being computed"
        if item.name in needed and not is_spare(item):
            return f"needed by {needed[item.name][0]}"
        return "used lately" if age_s(item, now) < older_than_s else ""

    return [Sentence(item, why(item), is_spare(item)) for item in held]
