"""Errors that a user can act on."""

from __future__ import annotations


class InputError(ValueError):
    """Bad input: says what was required, what came, and what to do.

    The command line prints it as one line and exits with code 2.
    """

    def __init__(self, required: str, got: str, action: str) -> None:
        super().__init__(f"{required}, got {got}. {action}")
        self.required = required
        self.got = got
        self.action = action

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        return InputError, (self.required, self.got, self.action)
