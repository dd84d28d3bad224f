"""The command line in processes of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
MOCOFLOW = [sys.executable, "-c", "from flows.command_line import main; main()"]
# What a run of the toy scene can do without where its scores do not matter.
QUICK = ("--set", "person_scores.use=off", "--set", "evaluation.frames_per_camera=1")


def started(*words: object, environment: Mapping[str, str] | None = None) -> subprocess.Popen:
    return subprocess.Popen(
        [*MOCOFLOW, *map(str, words)],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def done(*words: object, code: int = 0, environment: Mapping[str, str] | None = None) -> str:
    """Run it to its end; give what it prints."""
    return ended(started(*words, environment=environment), code)


def ended(process: subprocess.Popen, code: int = 0) -> str:
    said, _ = process.communicate(timeout=500.0)
    assert process.returncode == code, said
    return said


def reconstruct(scene: Path, root: Path, store: object) -> tuple[object, ...]:
    """The words that reconstruct a scene into ``root``."""
    return ("reconstruct", scene, "--preset", "toy", "--out", root, "--store", store, *QUICK)
