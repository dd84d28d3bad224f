"""An optimisation on however many devices: in this process, or in one process for each."""

from __future__ import annotations

import os
import shlex
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import torch

import mocoflow_core
from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.training.checkpoint import elapsed_at_checkpoint
from mocoflow_core.training.devices import Devices
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.job import TrainingJob, read_job
from mocoflow_core.training.launch import ProcessFailed, run_logged
from mocoflow_core.training.messages import Listener, Teller
from mocoflow_core.training.optimise_scene import RESULT, OptimisationResult
from mocoflow_core.training.ranks import FirstRankFailed, SeveralRanks, process_group_of
from mocoflow_core.training.snapshots import Snapshot

JOB = "job.json"
_RESTARTS = 1


class RanksFailed(RuntimeError):
    """A process of an optimisation on several devices died more often than it may."""


def optimise_on(
    devices: Devices,
    job: TrainingJob,
    workspace: Path,
    progress: Callable[[float, str], None],
    watch: Callable[[list[Snapshot]], None],
    leave_out: Callable[[float, float], None],
    log: Callable[[str], None],
) -> OptimisationResult:
    """Train a scene on one device in this process, or else under torch's elastic launcher.

    A rank that dies takes the others along, and all start again from the last checkpoint; a second
    death ends the run. The launcher stays in this process's group.

    Args:
        workspace: folder that survives a kill; other machines find the job in it, and read it only.
        leave_out: is told wall and CPU seconds that were no training: looking at the scene,
            starting processes.
        log: is given what the processes print.

    Raises:
        InputError, TrainingDiverged: as ``optimise_scene``.
        RanksFailed: after a second death, with the last lines that were printed.
    """
    if devices.in_all == 1:
        return job.run(workspace, progress, watch, leave_out)
    workspace.mkdir(parents=True, exist_ok=True)
    (workspace / RESULT).unlink(missing_ok=True)
    listener = Listener(workspace, progress, watch, log)
    earlier = elapsed_at_checkpoint(workspace)
    started = _clock()
    with _written(job, workspace / JOB) as file, tempfile.TemporaryDirectory() as meeting:
        command = launcher(devices, file, Path(meeting) / "meeting")
        if devices.machines > 1:
            others = shlex.join(["python", *joining(devices, file)[1:]])
            log(f"waiting for {devices.machines - 1} more; on each other machine: {others}")
        _run(command, listener, _environment(devices), workspace)
    result = OptimisationResult.from_json((workspace / RESULT).read_text())
    wall_s, cpu_s = (now - then for now, then in zip(_clock(), started, strict=True))
    leave_out(
        max(wall_s - (result.wall_s - earlier.wall), 0.0),
        max(cpu_s - (result.cpu_s - earlier.cpu), 0.0),
    )
    return result


def launcher(devices: Devices, job_file: Path, meeting: Path) -> list[str]:
    """The command that starts this machine's ranks, with the first of all among them.

    On one machine they meet at files and talk over loopback: nothing listens anywhere else.
    """
    if devices.machines == 1:
        where = [f"--rdzv-endpoint={meeting}", "--rdzv-conf=store_type=file"]
        how = [f"--meeting={meeting}"]
    else:
        where, how = [f"--rdzv-endpoint={devices.rendezvous}"], []
    return _launcher(devices, job_file, where, ["--leads", *how])


def joining(devices: Devices, job_file: Path) -> list[str]:
    """The command for each other machine."""
    return _launcher(devices, job_file, [f"--rdzv-endpoint={devices.rendezvous}"], [])


def _launcher(devices: Devices, job_file: Path, where: list[str], how: list[str]) -> list[str]:
    return [
        *(sys.executable, "-m", "mocoflow_core.training.elastic"),
        f"--nnodes={devices.machines}",
        f"--nproc-per-node={devices.here}",
        f"--max-restarts={_RESTARTS}",
        "--rdzv-backend=c10d",
        f"--rdzv-id={job_file.parent.name}",
        *where,
        *("-m", "mocoflow_core.training.worker", str(job_file), *how),
    ]


def _environment(devices: Devices) -> dict[str, str]:
    """The same code as in this process, one thread a rank, and one machine's talk kept inside."""
    package = str(Path(mocoflow_core.__file__).parents[1])
    environment = {
        "PYTHONPATH": os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH")))),
        "PYTHONUNBUFFERED": "1",
        "OMP_NUM_THREADS": "1",
        "TORCH_CPP_LOG_LEVEL": "ERROR",
    }
    if devices.machines > 1:
        return environment
    loopback = next((name for _, name in socket.if_nameindex() if name.startswith("lo")), "lo")
    return environment | {
        "TORCH_DISABLE_SHARE_RDZV_TCP_STORE": "1",
        "GLOO_SOCKET_IFNAME": loopback,
        "NCCL_SOCKET_IFNAME": loopback,
    }


def _run(
    command: list[str], listener: Listener, environment: dict[str, str], workspace: Path
) -> None:
    try:
        run_logged(command, listener.hear, environment)
    except ProcessFailed as ended:
        raise RanksFailed(
            f"A process died again after a restart, or none could start. {workspace} keeps the "
            "last checkpoint, if there was one: the same command goes on from there. If memory ran "
            f"out, ask for fewer --devices or a smaller schedule.rays. Printed last:\n{ended}"
        ) from ended
    if listener.failure is not None:
        raise listener.failure


@contextmanager
def _written(job: TrainingJob, file: Path) -> Iterator[Path]:
    file.write_text(job.model_dump_json(indent=1))
    try:
        yield file
    finally:
        file.unlink(missing_ok=True)


def _clock() -> tuple[float, float]:
    """Wall seconds, and CPU seconds of the processes that were waited for."""
    times = os.times()
    return time.perf_counter(), times.children_user + times.children_system


def run_rank(job_file: Path, leads: bool, meeting: Path | None) -> None:
    """The work of one rank, told by its environment which one it is.

    What would happen again in another try is told to the launching process, and is no failure of
    the rank, so that nobody starts it again.
    """
    torch.set_num_threads(1)
    tell = Teller()
    with process_group_of(meeting), suppress(FirstRankFailed):
        ranks = SeveralRanks(leads)
        place = f"The folder {job_file.parent}"
        try:
            with full_disk_is_bad_input(place):
                read_job(job_file).run(job_file.parent, tell.progress, tell.watch, ranks=ranks)
        except (InputError, TrainingDiverged) as error:
            if ranks.is_first:
                tell.failed(error)
