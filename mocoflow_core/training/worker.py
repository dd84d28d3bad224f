"""One rank of an optimisation: ``python -m mocoflow_core.training.worker JOB.json``.

Started by torch's elastic launcher, which gives it its number.
"""

from __future__ import annotations

import argparse
import signal
from pathlib import Path

from mocoflow_core.training.launch import die_with_parent


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("job", type=Path)
    options.add_argument("--leads", action="store_true", help="the first rank is on this machine")
    options.add_argument("--meeting", type=Path, help="file at which ranks of one machine meet")
    given = options.parse_args()
    # Before torch is imported: a launcher that is killed meanwhile leaves nobody behind.
    die_with_parent(signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from mocoflow_core.training.on_devices import run_rank

    run_rank(given.job, given.leads, given.meeting)


if __name__ == "__main__":
    main()
