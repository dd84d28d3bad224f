from __future__ import annotations

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.messages import Listener, Teller


class Heard:
    """A listener with all that it passes on, fed with what was printed."""

    def __init__(self, workspace, capsys) -> None:
        self.shares, self.curves, self.lines = [], [], []
        self.listener = Listener(
            workspace,
            lambda share, text: self.shares.append((share, text)),
            self.curves.append,
            self.lines.append,
        )
        for line in capsys.readouterr().out.splitlines():
            self.listener.hear(line)


def test_progress_and_snapshots_arrive_and_other_words_go_to_the_log(tmp_path, capsys):
    print("NCCL says hello", end="")
    Teller().progress(0.5, "step 10 of 20")
    Teller().watch([])
    print("goodbye")
    heard = Heard(tmp_path, capsys)
    assert heard.shares == [(0.5, "step 10 of 20")]
    assert heard.curves == [[]]
    assert heard.lines == ["NCCL says hello", "goodbye"]
    assert heard.listener.failure is None


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_ends_of_progress_are_progress(tmp_path, capsys, share):
    Teller().progress(share, "")
    assert Heard(tmp_path, capsys).shares == [(share, "")]


@pytest.mark.parametrize(
    "error", [InputError("a mask", "none", "Add one."), TrainingDiverged("stopped at step 3")]
)
def test_a_failure_arrives_as_what_it_is(tmp_path, capsys, error):
    Teller().failed(error)
    failure = Heard(tmp_path, capsys).listener.failure
    assert type(failure) is type(error)
    assert str(failure) == str(error)
