"""Options that take several values at once: ``--scenes turn walk``."""

from __future__ import annotations

from collections.abc import Iterable, Set

import typer
from typer.core import TyperCommand


class ListOptions(TyperCommand):
    """A command whose repeatable options may be written once with all their values."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:
        repeatable = {
            name
            for parameter in self.params
            if getattr(parameter, "multiple", False)
            for name in parameter.opts
        }
        return super().parse_args(ctx, spread(args, repeatable))


def spread(words: Iterable[str], repeatable: Set[str]) -> list[str]:
    """The words with each repeatable option written before every one of its values."""
    separate: list[str] = []
    option, values = "", 0
    for word in words:
        if word.startswith("--"):
            option, values = word, 0
        elif option in repeatable:
            values += 1
            separate += [option] if values > 1 else []
        separate.append(word)
    return separate
