"""Text of others inside Markdown: it is read as it is written, and does nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

# What begins a tag, an entity, a link, a picture, code, emphasis or a table's next cell. A single
# underscore inside a word means nothing.
_MEANS_SOMETHING = re.compile(r"[\\`*\[\]|~]")
# Where GitHub's Markdown finds an address without any brackets, some of its readers also behind
# a backslash: a character that nobody sees, and that no address has, stands there.
_ADDRESS = re.compile(r"(?<=www)(?=\.)|(?<=:)(?=//)|(?<=@)(?=[\w-]+\.)", re.IGNORECASE)
_WORD_JOINER = "\u2060"
# Two tildes would strike through.
_IN_ADDRESS = {r"~": "%7E", r"(?i)(?<=www)\.": "%2E"}
_HTML = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def plain(text: str) -> str:
    """Any text as one line of Markdown, also in a table: without links, tags or code."""
    line = _ADDRESS.sub(_WORD_JOINER, " ".join(text.split()))
    line = _MEANS_SOMETHING.sub(r"\\\g<0>", line)
    return "".join(_HTML.get(letter, letter) for letter in line)


def code(text: str) -> str:
    """Any text as one span of code, outside of tables."""
    line = " ".join(text.split())
    longest = max(map(len, re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}"


def file_link(text: str, file: Path) -> str:
    """A link to a file, also for readers who take such an address for text."""
    address = file.resolve().as_uri()
    for pattern, letters in _IN_ADDRESS.items():
        address = re.sub(pattern, letters, address)
    return f"[{text}]({address})"


def unlinked(text: str) -> str:
    """Any text for a cell that shows ``[text](address)`` as a link and nothing else as anything."""
    return text.replace("](", "] (")


def unlinked_rows(rows: Iterable[Mapping[str, object]]) -> list[dict[str, object]]:
    """A table of such cells, each text in it unlinked."""
    return [
        {name: unlinked(value) if isinstance(value, str) else value for name, value in row.items()}
        for row in rows
    ]
