"""What the first rank tells the process that started it, a line of JSON each."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from pydantic import JsonValue

from mocoflow_core.errors import InputError
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.snapshots import Snapshot, read_snapshots

_MARK = "mocoflow-rank: "


class Teller:
    """The worker's side."""

    def progress(self, share: float, text: str) -> None:
        _tell({"share": share, "text": text})

    def watch(self, curve: Sequence[Snapshot]) -> None:
        """The curve itself lies in the workspace."""
        _tell({"snapshots": len(curve)})

    def failed(self, error: InputError | TrainingDiverged) -> None:
        """What would happen again in another try."""
        if isinstance(error, InputError):
            _tell({"input": [error.required, error.got, error.action]})
        else:
            _tell({"diverged": str(error)})


def _tell(message: dict[str, JsonValue]) -> None:
    # In one write, as the ranks share their output: nobody's words come between.
    sys.stdout.write(f"\n{_MARK}{json.dumps(message)}\n")
    sys.stdout.flush()


class Listener:
    """The other side: passes on what is told, and everything else to the log."""

    def __init__(
        self,
        workspace: Path,
        progress: Callable[[float, str], None],
        watch: Callable[[list[Snapshot]], None],
        log: Callable[[str], None],
    ) -> None:
        self._workspace = workspace
        self._progress = progress
        self._watch = watch
        self._log = log
        self.failure: InputError | TrainingDiverged | None = None

    def hear(self, line: str) -> None:
        _, mark, message = line.partition(_MARK)
        if mark:
            self._understand(json.loads(message))
        elif line:
            self._log(line)

    def _understand(self, message: dict[str, JsonValue]) -> None:
        match message:
            case {"share": float(share), "text": str(text)}:
                self._progress(share, text)
            case {"snapshots": int()}:
                self._watch(read_snapshots(self._workspace))
            case {"input": [str(required), str(got), str(action)]}:
                self.failure = InputError(required, got, action)
            case {"diverged": str(words)}:
                self.failure = TrainingDiverged(words)
