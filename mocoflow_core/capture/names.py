"""Names that come with somebody else's files: none may do more than name something."""

from __future__ import annotations

import unicodedata
from typing import Annotated

from pydantic import AfterValidator

# Control characters, and the separators that end a line or a paragraph.
_UNPRINTED = ("Cc", "Zl", "Zp")


def is_one_line(text: str) -> bool:
    """Whether the text has neither line breaks nor other control characters."""
    return not any(unicodedata.category(letter) in _UNPRINTED for letter in text)


def _one_line(text: str) -> str:
    if not is_one_line(text):
        raise ValueError("a name is one line without control characters")
    return text


def _folder_name(text: str) -> str:
    if not text or text in (".", "..") or "/" in text or "\\" in text:
        raise ValueError("a folder is called like this: no slashes, neither '.' nor '..'")
    return _one_line(text)


OneLine = Annotated[str, AfterValidator(_one_line)]
FolderName = Annotated[str, AfterValidator(_folder_name)]
