"""What a cell of a benchmark costs beside its stages: Prefect, keys, files, processes.

    python -m benchmarks.orchestration --out FOLDER [--few 2] [--many 8] [--ways here server ...]

Every stage of every cell is in the store already, so that nothing is computed: what is left is
the orchestration. A benchmark of few cells and one of many are run; their difference, divided by
the cells that one has more, is the cost of a cell, and the rest is that of the start. CPU seconds
are those of all processes: the benchmark's, its workers', the server's and Dask's.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import psutil

from benchmarks.counting_proxy import Traffic, counting_proxy
from mocoflow_core.io.machine import describe_machine
from mocoflow_core.synthetic.toy import write_toy_scene
from tests.e2e.dask_cluster import cluster

MAIN = "from flows.command_line import main; main()"
WAYS = ("here", "server", "processes", "dask")
QUIET = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
    "PREFECT_LOGGING_LEVEL": "INFO",
    "DO_NOT_TRACK": "1",
    "OMP_NUM_THREADS": "1",
}


class Cost(NamedTuple):
    """Of one benchmark, or of one cell of it."""

    cpu_s: float
    wall_s: float
    around_cpu_s: float = 0.0  # of it the server's and Dask's
    requests: float = 0.0
    up_bytes: float = 0.0
    down_bytes: float = 0.0
    rows: float = 0.0
    database_bytes: float = 0.0

    def __sub__(self, other: Cost) -> Cost:
        return Cost(*(ours - theirs for ours, theirs in zip(self, other, strict=True)))

    def over(self, count: int) -> Cost:
        return Cost(*(value / count for value in self))


class Surroundings:
    """Processes that outlive a benchmark, and the server's database and traffic."""

    def __init__(self) -> None:
        self.environment: dict[str, str] = {}
        self.words: list[str] = []
        self.processes: list[int] = []
        self.database: Path | None = None
        self.traffic = Traffic()

    def now(self) -> Cost:
        """What they have cost so far."""
        cpu_s = sum(_cpu_s(pid) for pid in self.processes)
        rows, size = _database(self.database) if self.database else (0, 0)
        passed = self.traffic
        return Cost(
            cpu_s=cpu_s,
            wall_s=time.monotonic(),
            around_cpu_s=cpu_s,
            requests=float(passed.requests.total()),
            up_bytes=float(passed.up_bytes),
            down_bytes=float(passed.down_bytes),
            rows=float(rows),
            database_bytes=float(size),
        )


def main() -> None:
    arguments = _arguments()
    folder = Path(arguments.out)
    scene = folder / "toy"
    if not scene.is_dir():
        write_toy_scene(scene)
    seeds = (arguments.few, arguments.many)
    home = {"PREFECT_HOME": str(folder / "filling"), "XDG_CACHE_HOME": str(folder / "cache")}
    if not (folder / "filled/benchmark.html").is_file():
        _benchmark(folder, folder / "filled", seeds[1], [], home)
    for way in arguments.ways:
        with _surroundings(way, folder / way) as around:
            # The first one imports, migrates and warms up.
            _, few, many = [_measured(folder, way, n, around) for n in (seeds[0], *seeds)]
        found = {
            "machine": describe_machine(),
            "seeds": seeds,
            "cell": (many - few).over(seeds[1] - seeds[0])._asdict(),
            "few": few._asdict(),
            "requests of all": dict(around.traffic.requests.most_common()),
        }
        (folder / f"{way}.json").write_text(json.dumps(found, indent=1) + "\n")
        print(way, json.dumps(found["cell"]), flush=True)


def _measured(folder: Path, way: str, seeds: int, around: Surroundings) -> Cost:
    out = folder / way / "out"
    shutil.rmtree(out, ignore_errors=True)
    before = around.now()
    own_s = _benchmark(folder, out, seeds, around.words, around.environment)
    time.sleep(5.0)  # Events arrive after the runs that they tell of.
    spent = around.now() - before
    return spent._replace(cpu_s=spent.cpu_s + own_s, wall_s=spent.wall_s - 5.0)


def _benchmark(
    folder: Path, out: Path, seeds: int, words: list[str], environment: dict[str, str]
) -> float:
    """Run it; give the CPU seconds of its process and of all that it has waited for."""
    asked = ["--scenes", str(folder / "toy"), "--presets", "toy", "--methods", "mocoflow"]
    places = ["--store", str(folder / "store"), "--out", str(out), "--seeds", str(seeds)]
    before = os.times()
    subprocess.run(
        [sys.executable, "-c", MAIN, "benchmark", *asked, *places, *words],
        env={**os.environ, **QUIET, **environment},
        check=True,
    )
    after = os.times()
    return (after.children_user + after.children_system) - (
        before.children_user + before.children_system
    )


@contextmanager
def _surroundings(way: str, folder: Path) -> Iterator[Surroundings]:
    folder.mkdir(parents=True, exist_ok=True)
    around = Surroundings()
    home = {"PREFECT_HOME": str(folder / "prefect"), "XDG_CACHE_HOME": str(folder / "cache")}
    around.environment = home
    around.database = folder / "prefect/prefect.db"
    with ExitStack() as stack:
        if way != "here":
            server = stack.enter_context(_server(folder, home))
            around.processes.append(server[0])
            around.traffic = stack.enter_context(counting_proxy(server[1]))
            address = f"http://127.0.0.1:{around.traffic.port}/api"
            around.environment = {**home, "PREFECT_API_URL": address}
        if way == "processes":
            around.words = ["--workers", "2"]
        if way == "dask":
            made = stack.enter_context(cluster(folder, {**QUIET, **around.environment}))
            around.processes += [process.pid for process in made.processes.values()]
            around.words = ["--dask", made.address, "--slots", "GPU"]
        yield around


@contextmanager
def _server(folder: Path, home: dict[str, str]) -> Iterator[tuple[int, int]]:
    """Process id and port."""
    port = 20000 + os.getpid() % 20000
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1"]
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(
            [*command, "--port", str(port)],
            env={**os.environ, **QUIET, **home},
            stdout=log,
            stderr=log,
        )
    try:
        while not _listens(process.pid, port):
            if process.poll() is not None:
                raise RuntimeError((folder / "server.log").read_text())
            time.sleep(0.5)
        time.sleep(5.0)
        yield process.pid, port
    finally:
        process.terminate()
        process.wait()


def _listens(pid: int, port: int) -> bool:
    every = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    sockets = [s for process in every for s in process.net_connections("inet")]
    return any(s.laddr and s.laddr.port == port for s in sockets)


def _cpu_s(pid: int) -> float:
    process = psutil.Process(pid)
    times = [p.cpu_times() for p in (process, *process.children(recursive=True))]
    return sum(t.user + t.system for t in times)


def _database(file: Path) -> tuple[int, int]:
    """Rows of all tables, and bytes in use."""
    if not file.exists():
        return 0, 0
    with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
        tables = connection.execute("select name from sqlite_master where type='table'").fetchall()
        rows = sum(
            connection.execute(f'select count(*) from "{name}"').fetchone()[0] for (name,) in tables
        )
        pages, free, size = (
            connection.execute(f"pragma {what}").fetchone()[0]
            for what in ("page_count", "freelist_count", "page_size")
        )
    return rows, (pages - free) * size


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True)
    parser.add_argument("--few", type=int, default=2)
    parser.add_argument("--many", type=int, default=8)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    return parser.parse_args()


if __name__ == "__main__":
    main()
