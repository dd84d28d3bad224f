"""An optimisation as plain values and folders, so that another process can run it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.scene_shape import SceneShape
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.clock import Seconds, TrainingClock, unheard
from mocoflow_core.training.fit_motion import MotionStart
from mocoflow_core.training.network_stages import network_problem
from mocoflow_core.training.optimise_scene import OptimisationResult, optimise_scene, unwatched
from mocoflow_core.training.problem import Learned, Problem, shell_problem
from mocoflow_core.training.ranks import ALONE, Ranks
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.training.snapshots import Snapshot


class TrainingJob(ConfigurationPart):
    """The optimisation of a scene, whatever it is made of.

    Folders are those of finished stages, at the same paths on all machines. The ranks of one
    machine map the clip's file of frames, so that the disk is read once.
    """

    clip: Path
    learned: Learned
    losses: LossConfig
    schedule: ScheduleConfig
    seed: int
    before: Seconds = Field(description="training clock of the stages so far")

    @abstractmethod
    def problem(self, clip: Clip, ranks: Ranks) -> Problem:
        """What is learned, made anew."""

    def run(
        self,
        workspace: Path,
        progress: Callable[[float, str], None],
        watch: Callable[[list[Snapshot]], None] = unwatched,
        paused: Callable[[float, float], None] = unheard,
        ranks: Ranks = ALONE,
    ) -> OptimisationResult:
        """Train in this process, alone or as one of several; see ``optimise_scene``."""
        clip = Clip.load(self.clip)
        problem = self.problem(clip, ranks)
        return optimise_scene(
            clip,
            problem,
            self.schedule,
            self.seed,
            self.before,
            workspace,
            progress,
            watch,
            TrainingClock(paused),
        )


class ShellJob(TrainingJob):
    """With the fast representation."""

    kind: Literal["shell"] = "shell"
    density: Path
    motion: Path
    shape: SceneShape

    def problem(self, clip: Clip, ranks: Ranks) -> Problem:
        return shell_problem(
            CanonicalDensity.load(self.density),
            MotionStart.load(self.motion),
            self.shape,
            self.learned,
            self.losses,
            self.seed,
            ranks,
        )


class NetworkJob(TrainingJob):
    """With the paper's networks, from the weights that the stage before has left."""

    kind: Literal["networks"] = "networks"
    fitted: Path

    def problem(self, clip: Clip, ranks: Ranks) -> Problem:
        return network_problem(self.fitted, clip, self.learned, self.losses, self.seed, ranks)


_JOBS: TypeAdapter[ShellJob | NetworkJob] = TypeAdapter(
    Annotated[ShellJob | NetworkJob, Field(discriminator="kind")]
)


def read_job(file: Path) -> TrainingJob:
    """A job that was written as JSON. Raises InputError where there is none."""
    if not file.is_file():
        raise InputError(
            "The job of a run that has reached its optimisation",
            f"{file}, which does not exist",
            "Start the first machine first, with its store at the same path on all machines.",
        )
    return _JOBS.validate_json(file.read_bytes())
