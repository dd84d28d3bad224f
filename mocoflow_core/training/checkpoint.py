"""Checkpoints of the optimisation: everything that a resumed run needs to end the same."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import JsonValue
from safetensors.torch import load, save_file
from torch import Tensor, nn

from mocoflow_core.errors import InputError
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.guard import GuardEvent

_FILE = "checkpoint.safetensors"


@dataclass
class Progress:
    """Where the optimisation stands. Threads, steps and rays are fixed at the first start."""

    threads: int
    steps: int  # of the whole schedule; with a budget the most that are made
    rays: int  # of one step
    started_s: float = 0.0  # wall seconds of ``elapsed`` at the first step
    step: int = 0
    rate_scale: float = 1.0
    elapsed: Seconds = field(default_factory=Seconds)
    snapshot_s: float = 0.0  # wall seconds of ``elapsed`` at the last snapshot
    reached: bool = False  # the score at which the run may stop
    events: list[GuardEvent] = field(default_factory=list)
    best: float = math.inf  # the guard's: what the losses sum to where they are best
    recent: list[float] = field(default_factory=list)  # the guard's: sums of the last losses
    losses: list[dict[str, float]] = field(default_factory=list)  # of the last steps
    averaged: int = 0  # steps that the averaged weights have seen
    tries: int = 1

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Progress:
        values = json.loads(text)
        values["elapsed"] = Seconds(**values["elapsed"])
        values["events"] = [GuardEvent(**event) for event in values["events"]]
        return cls(**values)


class Restored(NamedTuple):
    """What a checkpoint holds besides the objects that it was loaded into."""

    progress: Progress
    good: dict[str, Tensor]  # the guard's last good state
    means: dict[str, Tensor]  # the weights averaged over the last steps


def save_checkpoint(
    folder: Path,
    made_with: Mapping[str, JsonValue],
    progress: Progress,
    model: nn.Module,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
    good: Mapping[str, Tensor],
    means: Mapping[str, Tensor],
) -> None:
    """Write beside, flush, rename: a kill at any moment leaves the old or the new checkpoint.

    Args:
        made_with: what a run must have in common with this one to go on from here.
        good: the guard's last good state, to which a resumed run may have to go back.
        means: the weights averaged over the last steps.
    """
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    for index, state in optimiser.state_dict()["state"].items():
        tensors |= {f"optimiser.{index}.{name}": value for name, value in state.items()}
    # Cloned: safetensors refuses tensors that share memory.
    tensors |= {f"good.{name}": value.clone() for name, value in good.items()}
    tensors |= {f"mean.{name}": value.clone() for name, value in means.items()}
    tensors["generator"] = generator.get_state()
    beside = folder / (_FILE + ".tmp")
    notes = {"progress": progress.to_json(), "made_with": json.dumps(made_with)}
    save_file(tensors, beside, metadata=notes)
    with beside.open("rb") as file:
        os.fsync(file.fileno())
    beside.replace(folder / _FILE)


def read_checkpoint(folder: Path) -> bytes:
    """The content of a folder's checkpoint; empty where there is none."""
    path = folder / _FILE
    return path.read_bytes() if path.is_file() else b""


def elapsed_at_checkpoint(folder: Path) -> Seconds:
    """What the training clock showed at a folder's checkpoint; nothing where there is none."""
    content = read_checkpoint(folder)
    return Progress.from_json(_metadata(content)["progress"]).elapsed if content else Seconds()


def restore_checkpoint(
    content: bytes,
    folder: Path,
    made_with: Mapping[str, JsonValue],
    model: nn.Module,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
) -> Restored:
    """Restore a checkpoint, read from a folder, into the given objects.

    Raises InputError where it was made with anything else than ``made_with``.
    """
    notes = _metadata(content)
    _require_same(json.loads(notes["made_with"]), json.loads(json.dumps(made_with)), folder)
    tensors = load(content)
    model.load_state_dict(_under("model.", tensors))
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in _under("optimiser.", tensors).items():
        index, part = name.split(".", 1)
        state.setdefault(int(index), {})[part] = value
    optimiser.load_state_dict({**optimiser.state_dict(), "state": state})
    generator.set_state(tensors["generator"])
    progress = Progress.from_json(notes["progress"])
    return Restored(progress, _under("good.", tensors), _under("mean.", tensors))


def _metadata(content: bytes) -> dict[str, str]:
    """The text entries of a safetensors file: its length of the header, then the header."""
    length = int.from_bytes(content[:8], "little")
    return dict(json.loads(content[8 : 8 + length])["__metadata__"])


def _require_same(held: JsonValue, asked: JsonValue, folder: Path, name: str = "") -> None:
    if isinstance(held, dict) and isinstance(asked, dict):
        for part in sorted({*held, *asked}):
            _require_same(held.get(part), asked.get(part), folder, f"{name}.{part}".lstrip("."))
    elif held != asked:
        raise InputError(
            f"The checkpoint in {folder} was made with {name} = {held!s:.60}",
            f"a run with {asked!s:.60}",
            f"Go on with {name} = {held!s:.60}, or remove {folder / _FILE} to start again.",
        )


def remove_checkpoint(folder: Path) -> None:
    """The stage is done: its checkpoint is no longer needed."""
    (folder / _FILE).unlink(missing_ok=True)


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name[len(prefix) :]: t for name, t in tensors.items() if name.startswith(prefix)}
