"""Changes sound data files at random and reads them, for as long as one likes.

    python -m tests.io.fuzz_untrusted --minutes 10

Each input follows from its number and the seed. Anything but a plain structure or an InputError
is a finding: another exception, a dead process, more than the allowed memory or time. Findings are
kept in ``--keep`` under the number of their input, and the exit code is 1. Refusals are counted by
what caused them: where that is an exception of a library, the message could be clearer.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import Limits, read_untrusted
from tests.io.untrusted.mutations import edited, impure, inside, random_edits
from tests.io.untrusted.random_pickles import random_pickle
from tests.io.untrusted.valid_files import write_valid_files

MEMORY_BYTES = 4 * 2**30  # address space, most of it the libraries'
LIMITS = Limits(made_bytes=2**28, free_growth_bytes=2**26, steps=200_000, seconds=5)
SECONDS_EACH = 10
BATCH = 500
# Each HDF5 file starts a process: a hundred times the cost of the others.
SHARE_OF_HDF5 = 0.005
SHARE_OF_RANDOM_PICKLES = 0.25


class _Sources:
    """The sound files, read once."""

    def __init__(self, folder: Path) -> None:
        files = write_valid_files(folder)
        self.hdf5 = [f for f in files if f.suffix == ".hdf5"]
        self.others = [f for f in files if f.suffix != ".hdf5"]
        self._data = {f: f.read_bytes() for f in files}

    def input(self, number: int, seed: int) -> tuple[str, bytes]:
        """The kind and the bytes of one input."""
        random = Random(f"{seed}/{number}")
        draw = random.random()
        if draw < SHARE_OF_RANDOM_PICKLES:
            return "random instructions", random_pickle(random)
        if draw < SHARE_OF_RANDOM_PICKLES + SHARE_OF_HDF5:
            path = random.choice(self.hdf5)
            return path.name, edited(self._data[path], random_edits(random), self._data[path])
        path, other = random.choice(self.others), random.choice(self.others)
        edits = random_edits(random)
        if random.random() < 0.5:
            content, pack = inside(path)
            return f"inside {path.name}", pack(edited(content, edits, self._data[other]))
        return path.name, edited(self._data[path], edits, self._data[other])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz_findings"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sources = _Sources(Path(folder))
        outcomes, slowest, findings = _run(sources, options, Path(folder))
    total = sum(outcomes.values())
    print(f"{total} inputs, seed {options.seed}: {dict(sorted(outcomes.items()))}")
    print(f"slowest: {slowest[0]:.2f} s ({slowest[1]}); findings: {findings}")
    sys.exit(1 if findings else 0)


def _run(sources, options, folder):
    outcomes, slowest, findings, number = Counter(), (0.0, ""), 0, 0
    end = time.monotonic() + 60 * options.minutes
    while time.monotonic() < end:
        report = folder / "report.json"
        report.unlink(missing_ok=True)
        process = os.fork()
        if process == 0:
            _batch(sources, number, options, folder)
        _, status = os.waitpid(process, 0)
        if status:
            current = int((folder / "current").read_text())
            print(f"input {current}: the process ended with status {status}")
            _keep(sources, current, options)
            findings, number = findings + 1, current + 1
            outcomes["dead process"] += 1
            continue
        batch = json.loads(report.read_text())
        outcomes.update(batch["outcomes"])
        slowest = max(slowest, tuple(batch["slowest"]))
        findings += batch["findings"]
        number += BATCH
    return outcomes, slowest, findings


def _batch(sources, first, options, folder):
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGALRM, _too_slow)
    outcomes, slowest, findings = Counter(), (0.0, ""), 0
    for number in range(first, first + BATCH):
        (folder / "current").write_text(str(number))
        kind, data = sources.input(number, options.seed)
        start = time.perf_counter()
        outcome = _outcome(folder / "input", data)
        slowest = max(slowest, (time.perf_counter() - start, f"{kind}, input {number}"))
        outcomes[outcome] += 1
        if not outcome.startswith(("read", "refused")):
            print(f"input {number} ({kind}): {outcome}")
            _keep(sources, number, options)
            findings += 1
    (folder / "report.json").write_text(
        json.dumps({"outcomes": outcomes, "slowest": slowest, "findings": findings})
    )
    os._exit(0)


def _outcome(path, data):
    path.write_bytes(data)
    signal.alarm(SECONDS_EACH)
    try:
        strange = impure(read_untrusted(path, LIMITS))
        return f"gave {type(strange[0]).__name__}" if strange else "read"
    except InputError as error:
        causes = _causes(error)
        return "out of memory" if "MemoryError" in causes else " < ".join(["refused", *causes])
    except BaseException as error:
        traceback.print_exc()
        return type(error).__name__
    finally:
        signal.alarm(0)


class _TooSlow(BaseException):
    """No reader catches this one."""


def _too_slow(*_):
    raise _TooSlow


def _causes(error):
    """Names of the exceptions behind a refusal, InputErrors apart."""
    names = []
    while (error := error.__cause__) is not None:
        names += [] if isinstance(error, InputError) else [type(error).__name__]
    return names


def _keep(sources, number, options):
    options.keep.mkdir(parents=True, exist_ok=True)
    (options.keep / f"{options.seed}_{number}").write_bytes(sources.input(number, options.seed)[1])


if __name__ == "__main__":
    main()
