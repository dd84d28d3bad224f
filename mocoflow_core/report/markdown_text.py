"""Text of others inside Markdown: it is read as it is written, and does nothing."""

from __future__ import annotations

import re

# What begins a tag, an entity, a link, a picture, code, emphasis or a table's next cell. A single
# underscore inside a word means nothing.
_MEANS_SOMETHING = re.compile(r"[\\`*\[\]|~]")
_HTML = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def plain(text: str) -> str:
    """Any text as one line of Markdown, also in a table: without links, tags or code."""
    line = _MEANS_SOMETHING.sub(r"\\\g<0>", " ".join(text.split()))
    return "".join(_HTML.get(letter, letter) for letter in line)


def code(text: str) -> str:
    """Any text as one span of code, outside of tables."""
    line = " ".join(text.split())
    longest = max(map(len, re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}"


def unlinked(text: str) -> str:
    """Any text for a cell that shows ``[text](address)`` as a link and nothing else as anything."""
    return text.replace("](", "] (")
