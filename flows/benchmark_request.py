"""What a user asked to be compared, resolved: cells with their scenes and settings."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, model_validator

from flows.allowed_folders import AllowedFolders
from flows.benchmark_scenes import AskedScene, in_full, read_scenes
from flows.reasons import reason_of
from flows.request import Request
from flows.users_store import open_users_store
from flows.workers import Workers
from mocoflow_core.errors import InputError
from mocoflow_core.io.store import Store
from mocoflow_core.methods.ablations import SETTINGS, require_method
from mocoflow_core.methods.benchmark_folder import BenchmarkFolder, BenchmarkRecord, CellRecord
from mocoflow_core.methods.experiments import EXPERIMENTS, USUAL, Experiment
from mocoflow_core.methods.scoring import METHODS
from mocoflow_core.metrics.person_judge import require_own_networks
from mocoflow_core.metrics.time_to_target import TargetConfig, read_target, require_measured
from mocoflow_core.presets import PRESETS
from mocoflow_core.settings import with_settings

# What an experiment says where the user does not.
_FROM_EXPERIMENT = ("scenes", "methods", "presets")


class Cell(NamedTuple):
    """One run: where it is recorded, what the flow is asked for, and where its results go.

    All paths are absolute: a cell may run in another process.
    """

    record: CellRecord
    request: Request
    out: Path


class BenchmarkRequest(BaseModel):
    """The parameters of a benchmark; the flow and the command line share them.

    What is absent or None is taken from the experiment; its settings come before the user's.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    experiment: str | None = None
    scenes: tuple[str, ...]
    out: Path
    methods: tuple[str, ...]
    presets: tuple[str, ...]
    seeds: int = 3
    budget_s: float | None = None
    settings: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    store_url: str | None = None
    afresh: bool = False
    workers: int = 1
    dask: str | None = None
    slots: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _filled_in(cls, asked: Mapping[str, Any]) -> dict[str, Any]:
        experiment = EXPERIMENTS.get(str(asked.get("experiment")), USUAL)
        said = {name: value for name, value in asked.items() if value is not None}
        settings = dict.fromkeys((*experiment.settings, *said.get("settings", ())))
        from_experiment = {name: getattr(experiment, name) for name in _FROM_EXPERIMENT}
        return {**from_experiment, **said, "settings": tuple(settings)}

    @property
    def compares(self) -> Experiment:
        """The experiment, or the usual comparison."""
        return USUAL if self.experiment is None else EXPERIMENTS[self.experiment]

    @property
    def runs_on(self) -> Workers:
        return Workers(count=self.workers, dask=self.dask, slots=self.slots)

    @cached_property
    def store(self) -> Store:
        return open_users_store(str(self.place / "store") if self.afresh else self.store_url)

    @cached_property
    def waited_for(self) -> TargetConfig:
        """The targets given, or the usual ones."""
        given = tuple(map(read_target, self.targets))
        return TargetConfig(targets=given) if given else TargetConfig()

    @cached_property
    def asked_scenes(self) -> tuple[AskedScene, ...]:
        """Raises InputError for a scene that is none, and for two of one name."""
        return read_scenes(self.scenes)

    @property
    def command(self) -> str:
        """The command line that asks for the same."""
        words = ["mocoflow", "benchmark", *self._asked(self.scenes), "--out", str(self.out)]
        words += ["--store", self.store_url] if self.store_url else []
        words += ["--afresh"] if self.afresh else []
        return shlex.join([*words, *self.runs_on.words])

    @property
    def question(self) -> str:
        """What is asked, and on what it runs; where the results go decides nothing."""
        return shlex.join([*self._asked(map(in_full, self.scenes)), *self.runs_on.words])

    def _asked(self, scenes: Iterable[str]) -> list[str]:
        words = ["--experiment", self.experiment] if self.experiment else []
        words += ["--scenes", *scenes]
        words += ["--methods", *self.methods] if self.methods else []
        words += ["--presets", *self.presets, "--seeds", str(self.seeds)]
        if self.budget_s is not None:
            words += ["--budget", f"{self.budget_s:g}"]
        for setting in self.settings:
            words += ["--set", setting]
        return [*words, "--targets", *self.targets] if self.targets else words

    def claim(self) -> BenchmarkFolder:
        """Take the output folder. Raises InputError for anything that no cell could run with."""
        self._check()
        begun = BenchmarkRecord(
            experiment=self.experiment,
            settings=self.settings,
            budget_s=self.budget_s,
            command=self.command,
            question=self.question,
        )
        return BenchmarkFolder.claim(self.place, begun)

    @cached_property
    def place(self) -> Path:
        """Where the results go. Raises InputError for a folder that may not be written."""
        return AllowedFolders.of_environment().to_write(self.out, "out")

    def cells(self) -> Iterator[Cell]:
        """Every scene with every preset, method that runs, and seed; scenes made when needed."""
        for scene in self.asked_scenes:
            for preset in self.presets:
                for method in self._running():
                    for seed in range(self.seeds):
                        yield self._cell(scene, preset, method, seed)

    @property
    def shifted_scenes(self) -> tuple[AskedScene, ...]:
        """Those whose photographs are scored misplaced."""
        return self.asked_scenes if self.compares.shifts_views else ()

    def shifted(self, scene: AskedScene) -> Request:
        """What one of them is extracted by. Raises what keeps the scene from being made."""
        return self._request(scene, scene.folder(), self.presets[0], (), 0)

    def _request(
        self, scene: AskedScene, folder: Path, preset: str, changes: tuple[str, ...], seed: int
    ) -> Request:
        return Request(
            scene_path=folder.resolve(),
            preset=preset,
            seed=seed,
            budget_s=self.budget_s,
            settings=(*self.settings, *scene.settings, *changes),
            import_settings=scene.import_settings,
            store_url=self.store.url if self.store_url or self.afresh else None,
        )

    def _cell(self, scene: AskedScene, preset: str, method: str, seed: int) -> Cell:
        folder = f"cells/{scene.name}/{preset}/{method}/{seed}"
        place, fault = _made(scene)
        refusal = fault or self._refusal(preset, method)
        record = CellRecord(
            scene=scene.name,
            preset=preset,
            method=method,
            seed=seed,
            folder=folder,
            # Failed until it is known to have finished.
            state="refused" if refusal else "failed",
            reason=reason_of(refusal) if refusal else "",
        )
        request = self._request(scene, place, preset, SETTINGS[method], seed)
        return Cell(record, request, self.place.resolve() / folder)

    def _refusal(self, preset: str, method: str) -> InputError | None:
        """Why a method makes no sense with a preset and the settings, if it does not."""
        try:
            require_method(method, PRESETS[preset](), self.settings)
        except InputError as error:
            return error
        return None

    def _running(self) -> list[str]:
        """The methods that have runs of their own; the others are scored within those."""
        return [method for method in self.methods if method in SETTINGS]

    def _check(self) -> None:
        if self.afresh and self.store_url:
            raise InputError(
                "--afresh has a store of its own",
                f"--store {self.store_url} as well",
                "Give one of both.",
            )
        if self.experiment is not None:
            _all_known("--experiment", (self.experiment,), tuple(EXPERIMENTS))
        _all_known("--presets", self.presets, tuple(PRESETS))
        _all_known("--methods", self.methods, (*SETTINGS, *METHODS))
        idle = not self._running() and not self.compares.shifts_views
        if idle or not self.asked_scenes or self.seeds < 1:
            raise InputError(
                "A benchmark has a scene, a seed, and a method that is run",
                f"--scenes {' '.join(self.scenes)} --methods {' '.join(self.methods)} "
                f"--seeds {self.seeds}",
                "posed_mesh alone is scored within the runs of another method.",
            )
        for preset in self.presets:
            chosen = with_settings(PRESETS[preset](), self.settings)
            AllowedFolders.of_environment().check_files(chosen)
            person = chosen.person_scores
            require_own_networks(person)
            require_measured(self.waited_for, person.on_curve and person.use != "off")
        refusals = [self._refusal(p, m) for p in self.presets for m in self._running()]
        if refusals and all(refusals):
            raise next(filter(None, refusals))
        self.runs_on.check()


def _made(scene: AskedScene) -> tuple[Path, Exception | None]:
    """Where a scene lies, and what kept it from being made, which is the end of no other."""
    try:
        return scene.folder(), None
    except Exception as error:
        return Path(scene.where), error


def _all_known(option: str, given: tuple[str, ...], known: tuple[str, ...]) -> None:
    unknown = [name for name in given if name not in known]
    if unknown or len(set(given)) < len(given):
        raise InputError(
            f"{option} must be different ones of {', '.join(dict.fromkeys(known))}",
            " ".join(unknown or given),
            "Choose from these.",
        )
