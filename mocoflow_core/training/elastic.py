"""Torch's elastic launcher, ``python -m torch.distributed.run``, that ends with its parent.

The launcher keeps its workers in sessions of their own and stops them when it is told to end. It
is told by itself here: to do so between fork and exec is unsafe in a parent with threads.
"""

from __future__ import annotations

import signal

from mocoflow_core.training.launch import die_with_parent

if __name__ == "__main__":
    die_with_parent(signal.SIGTERM)
    from torch.distributed.run import main

    main()
