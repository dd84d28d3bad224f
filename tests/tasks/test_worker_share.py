"""A process that takes its share finds no more cores afterwards."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from mocoflow_core.training import devices

CORES = sorted(os.sched_getaffinity(0))
SAY = """
import os
from tasks.worker_share import is_confined, take_share
take_share(0, 2), take_share(1, 2)
print(sorted(os.sched_getaffinity(0)), os.environ.get("CUDA_VISIBLE_DEVICES"))
"""


@pytest.mark.skipif(len(CORES) < 2, reason="one core cannot be shared")
def test_a_share_is_a_part_of_what_the_process_began_with():
    said = subprocess.run([sys.executable, "-c", SAY], capture_output=True, text=True, check=True)
    assert said.stdout.split(" None")[0] == str(CORES[len(CORES) // 2 :])


@pytest.mark.parametrize(
    ("named", "count", "gpus"),
    [
        (None, 0, ()),
        (None, 2, ("0", "1")),
        ("3, 5", 2, ("3", "5")),
        ("GPU-a,GPU-b,GPU-c", 2, ("GPU-a", "GPU-b")),
        ("", 0, ()),
    ],
)
def test_gpus_are_called_as_the_environment_calls_them(named, count, gpus, monkeypatch):
    monkeypatch.setattr(devices.torch.cuda, "device_count", lambda: count)
    assert devices.visible_gpus(named) == gpus
