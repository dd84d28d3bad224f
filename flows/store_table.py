"""What a store holds, as lines of text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from mocoflow_core.io.garbage import Sentence, age_s
from mocoflow_core.io.holdings import Held


def artifact_table(
    held: Sequence[Held], needed: Mapping[str, list[str]], now: float
) -> Iterator[str]:
    """A line for each artifact and leftover, the youngest of each stage first."""
    rows = [("artifact", "age", "size", "seconds", "needed by; what is wrong")]
    for item in sorted(held, key=lambda item: (item.name.partition("/")[0], -item.used_at)):
        cost = "" if item.wall_s is None else f"{item.wall_s:.1f}"
        remarks = [] if item.leftover else needed.get(item.name, ["no run"])
        remarks = [*remarks, *([item.fault] if item.fault else [])]
        rows.append((item.name, age(age_s(item, now)), size(item.size), cost, "; ".join(remarks)))
    yield from _aligned(rows) if len(rows) > 1 else ()


def garbage_table(place: str, sentences: Sequence[Sentence]) -> Iterator[str]:
    """A line for everything that goes, and why how much of the rest stays."""
    yield f"{place}: {summary([sentence.held for sentence in sentences])}"
    yield from _aligned(
        [("goes", s.held.name, size(s.held.size), s.held.fault or "") for s in sentences if s.goes]
    )
    stays = Counter(sentence.why.partition(" by ")[0] for sentence in sentences if sentence.why)
    for why, count in sorted(stays.items()):
        yield f"stays: {count} {why}"


def summary(held: Iterable[Held]) -> str:
    """How much there is of what."""
    held = list(held)
    artifacts = [item for item in held if not item.leftover]
    broken = sum(item.fault is not None for item in artifacts)
    leftovers = [item for item in held if item.leftover]
    words = [f"{len(artifacts)} artifacts, {size(sum(item.size for item in artifacts))}"]
    words += [f"{broken} broken"] if broken else []
    if leftovers:
        words.append(f"{len(leftovers)} unfinished, {size(sum(item.size for item in leftovers))}")
    return "; ".join(words)


def size(count: float) -> str:
    """Bytes in the unit that leaves one to three digits before the point."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} TB"


def age(seconds: float) -> str:
    """Seconds in the largest unit of which there are two or more."""
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _aligned(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()
