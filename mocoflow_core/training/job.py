"""An optimisation as plain values and folders, so that another process can run it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.clock import Seconds, TrainingClock, unheard
from mocoflow_core.training.fit_motion import MotionStart
from mocoflow_core.training.optimise_scene import OptimisationResult, optimise_scene, unwatched
from mocoflow_core.training.problem import Learned, shell_problem
from mocoflow_core.training.ranks import ALONE, Ranks
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import Snapshot


class ShellJob(ConfigurationPart):
    """The fast representation's optimisation.

    Folders are those of finished stages, the same on all machines. Ranks of one machine map the
    clip's file of frames, so that it is read from the disk once.
    """

    clip: Path
    density: Path
    motion: Path
    shape: SceneShape
    learned: Learned
    losses: LossConfig
    schedule: ScheduleConfig
    seed: int
    before: Seconds

    def run(
        self,
        workspace: Path,
        progress: Callable[[float, str], None],
        watch: Callable[[list[Snapshot]], None] = unwatched,
        paused: Callable[[float, float], None] = unheard,
        ranks: Ranks = ALONE,
    ) -> OptimisationResult:
        """Train in this process, alone or as one of several; see ``optimise_scene``."""
        problem = shell_problem(
            CanonicalDensity.load(self.density),
            MotionStart.load(self.motion),
            self.shape,
            self.learned,
            self.losses,
            self.seed,
            ranks,
        )
        return optimise_scene(
            Clip.load(self.clip),
            problem,
            self.schedule,
            self.seed,
            self.before,
            workspace,
            progress,
            watch,
            TrainingClock(paused),
        )


def read_job(file: Path) -> ShellJob:
    """A job that was written as JSON. Raises InputError where there is none."""
    if not file.is_file():
        raise InputError(
            "The job of a run that has reached its optimisation",
            f"{file}, which does not exist",
            "Start the first machine first, with its store at the same path on all machines.",
        )
    return ShellJob.model_validate_json(file.read_bytes())
