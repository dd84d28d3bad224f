"""The processes that share one optimisation: which rays are whose, and what all see together.

Every rank draws the whole batch with the same generator and renders its own rays of it, so that
what is drawn does not depend on how many there are. Losses are parts of joint means, gradients are
sums over ranks, and whatever is decided is decided on joint values or by the first rank.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import torch
import torch.distributed as process_group
from pydantic import JsonValue
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from mocoflow_core.training.clock import Seconds

Value = TypeVar("Value", bound=JsonValue)
Losses = Callable[..., dict[str, Tensor]]


class FirstRankFailed(RuntimeError):
    """The first rank could not do what the others were waiting for; it says why itself."""


class Ranks:
    """One process alone: its part is the whole, and it agrees with itself."""

    rank = 0
    count = 1
    device = torch.device("cpu")

    @property
    def is_first(self) -> bool:
        return self.rank == 0

    def part(self, whole: int) -> slice:
        """Which of so many rays are this rank's: all of them once, in order, evenly."""
        return slice(self.rank * whole // self.count, (self.rank + 1) * whole // self.count)

    def share(self, model: nn.Module, losses: Losses) -> Losses:
        """The losses with gradients of the model that are means over ranks.

        The model's weights become those of the first rank; they stay equal as long as every rank
        takes the same steps. Keep what is returned until the gradients are there.
        """
        return losses

    def total(self, own: Tensor) -> Tensor:
        """Sum over ranks, the same to the last bit on all of them; carries no gradient."""
        return own

    def before(self, own: int) -> tuple[int, int]:
        """How many things the earlier ranks have, and how many there are in all."""
        return 0, own

    def seconds(self, own: Seconds) -> Seconds:
        """Wall seconds of the first rank and CPU seconds of all."""
        return own

    def first(self, work: Callable[[], Value]) -> Value:
        """Let the first rank do something and tell all what came of it; the others wait.

        Raises FirstRankFailed on the others when it raises anything.
        """
        return work()

    def first_bytes(self, work: Callable[[], bytes]) -> bytes:
        """The same for bytes."""
        return work()


ALONE = Ranks()


class _Shared(nn.Module):
    """Losses as the module that they are for torch: whose weights they pull on."""

    def __init__(self, model: nn.Module, losses: Losses) -> None:
        super().__init__()
        self.model = model
        self._losses = losses

    def forward(self, *given: Any) -> dict[str, Tensor]:  # noqa: ANN401 - whatever they take
        return self._losses(*given)


class SeveralRanks(Ranks):
    """One process of torch's default process group, which must exist already.

    Decisions travel as CPU tensors, gradients on the device that the weights lie on.
    """

    def __init__(self, leads: bool = True) -> None:
        """Args: leads: the first rank is the lowest one that does; one at least must."""
        self.rank = process_group.get_rank()
        self.count = process_group.get_world_size()
        if torch.cuda.is_available():
            self.device = torch.device("cuda", torch.cuda.current_device())
        leader = torch.tensor(self.rank if leads else self.count)
        process_group.all_reduce(leader, process_group.ReduceOp.MIN)
        self._leader = int(leader)
        if self._leader == self.count:
            raise RuntimeError("none of these machines leads: the run itself is not among them")

    @property
    def is_first(self) -> bool:
        return self.rank == self._leader

    def share(self, model: nn.Module, losses: Losses) -> Losses:
        with warnings.catch_warnings():
            # The newer name of this option is not in every torch that will do.
            warnings.simplefilter("ignore", FutureWarning)
            # Buffers never change; a loss of weight zero leaves a network out.
            return DistributedDataParallel(
                _Shared(model, losses), broadcast_buffers=False, find_unused_parameters=True
            )

    def total(self, own: Tensor) -> Tensor:
        summed = own.detach().clone()
        process_group.all_reduce(summed)
        return summed

    def before(self, own: int) -> tuple[int, int]:
        counts = torch.zeros(self.count, dtype=torch.int64)
        counts[self.rank] = own
        process_group.all_reduce(counts)
        return int(counts[: self.rank].sum()), int(counts.sum())

    def seconds(self, own: Seconds) -> Seconds:
        joint = torch.tensor([own.wall if self.is_first else 0.0, own.cpu], dtype=torch.float64)
        process_group.all_reduce(joint)
        return Seconds(*joint.tolist())

    def first(self, work: Callable[[], Value]) -> Value:
        said = self.first_bytes(lambda: json.dumps(work()).encode())
        return cast(Value, json.loads(said))

    def first_bytes(self, work: Callable[[], bytes]) -> bytes:
        done = b""
        if self.is_first:
            try:
                done = b"+" + work()
            except BaseException:
                _broadcast(b"-", self._leader)
                raise
        done = _broadcast(done, self._leader)
        if not done.startswith(b"+"):
            raise FirstRankFailed("the first rank failed; its own words say why")
        return done[1:]


def own_of(drawn: Tensor, earlier: int, own: int) -> Tensor:
    """Those of the numbers drawn from all ranks' things that are this rank's, counted from its own.

    Things are sorted by ray, so one draw over those of all ranks is the draw of a process that
    has all rays.
    """
    mine = drawn - earlier
    return mine[(mine >= 0) & (mine < own)]


@contextmanager
def process_group_of(meeting: Path | None) -> Iterator[None]:
    """Be one of the processes that torch's elastic launcher started, while they last.

    Gradients travel over NCCL where there are GPUs, everything else over gloo.

    Args:
        meeting: file beside which all ranks find each other; None: where the launchers met.
    """
    number, count = int(os.environ["RANK"]), int(os.environ["WORLD_SIZE"])
    backend = "cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "gloo"
    if torch.cuda.is_available():
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]))
    store = None
    if meeting is not None:
        # Each start meets anew.
        file = meeting.with_suffix(f".{os.environ['TORCHELASTIC_RESTART_COUNT']}")
        store = process_group.FileStore(str(file), count)
    process_group.init_process_group(backend, store=store, rank=number, world_size=count)
    try:
        yield
    finally:
        process_group.destroy_process_group()


def _broadcast(content: bytes, source: int) -> bytes:
    """The content that one rank has, on all."""
    length = torch.tensor(len(content))
    process_group.broadcast(length, source)
    carried = torch.zeros(int(length), dtype=torch.uint8)
    if process_group.get_rank() == source:
        carried.numpy()[:] = np.frombuffer(content, np.uint8)
    process_group.broadcast(carried, source)
    return carried.numpy().tobytes()
