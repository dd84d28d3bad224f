"""What a user asked to be compared, resolved: cells with their scenes and settings."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from flows.demo_scene import demo_scene
from flows.request import Request, open_users_store
from mocoflow_core.errors import InputError
from mocoflow_core.io.store import Store
from mocoflow_core.methods.ablations import SETTINGS
from mocoflow_core.methods.benchmark_folder import BenchmarkFolder, BenchmarkRecord, CellRecord
from mocoflow_core.methods.scoring import METHODS
from mocoflow_core.metrics.time_to_target import TargetConfig, read_target
from mocoflow_core.presets import PRESETS
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.catalogue import named_scene


class Cell(NamedTuple):
    """One run: where it is recorded, what the flow is asked for, and where its results go."""

    record: CellRecord
    request: Request
    out: Path


class BenchmarkRequest(BaseModel):
    """The parameters of a benchmark; the flow and the command line share them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scenes: tuple[str, ...]
    out: Path
    methods: tuple[str, ...] = METHODS
    presets: tuple[str, ...] = ("fast",)
    seeds: int = 3
    budget_s: float | None = None
    settings: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    store_url: str | None = None

    @cached_property
    def store(self) -> Store:
        return open_users_store(self.store_url)

    @cached_property
    def waited_for(self) -> TargetConfig:
        """The targets given, or the usual ones."""
        given = tuple(map(read_target, self.targets))
        return TargetConfig(targets=given) if given else TargetConfig()

    @cached_property
    def names(self) -> dict[str, str]:
        """What each scene is called: a folder by its last part, a synthetic one as written.

        Raises InputError for a scene that is neither, and for two of one name.
        """
        names: dict[str, str] = {}
        for scene in self.scenes:
            name = Path(scene).resolve().name if _is_folder(scene) else named_scene(scene).name
            if _is_folder(scene) and not Path(scene).is_dir():
                raise InputError(
                    "A scene is a folder or a synthetic one's name", repr(scene), "Check the path."
                )
            if name in names:
                raise InputError(
                    "Scenes of a benchmark have different names", repr(name), "Rename a folder."
                )
            names[name] = scene
        return names

    @property
    def command(self) -> str:
        """The command line that asks for the same."""
        words = ["mocoflow", "benchmark", "--scenes", *self.scenes, "--methods", *self.methods]
        words += ["--presets", *self.presets, "--seeds", str(self.seeds), "--out", str(self.out)]
        if self.budget_s is not None:
            words += ["--budget", f"{self.budget_s:g}"]
        for setting in self.settings:
            words += ["--set", setting]
        if self.targets:
            words += ["--targets", *self.targets]
        return shlex.join([*words, *(["--store", self.store_url] if self.store_url else [])])

    def claim(self) -> BenchmarkFolder:
        """Take the output folder. Raises InputError for anything that no cell could run with."""
        self._check()
        begun = BenchmarkRecord(
            settings=self.settings, budget_s=self.budget_s, command=self.command
        )
        return BenchmarkFolder.claim(self.out, begun)

    def cells(self) -> Iterator[Cell]:
        """Every scene with every preset, method that runs, and seed; scenes made when needed."""
        for name, scene in self.names.items():
            path = Path(scene) if _is_folder(scene) else demo_scene(scene)
            for preset in self.presets:
                for method in self._running():
                    for seed in range(self.seeds):
                        yield self._cell(name, path, preset, method, seed)

    def _cell(self, name: str, path: Path, preset: str, method: str, seed: int) -> Cell:
        folder = f"cells/{name}/{preset}/{method}/{seed}"
        # Failed until it is known to have finished.
        record = CellRecord(
            scene=name, preset=preset, method=method, seed=seed, folder=folder, state="failed"
        )
        request = Request(
            scene_path=path,
            preset=preset,
            seed=seed,
            budget_s=self.budget_s,
            settings=(*self.settings, *SETTINGS[method]),
            store_url=self.store_url,
        )
        return Cell(record, request, self.out / folder)

    def _running(self) -> list[str]:
        """The methods that have runs of their own; the others are scored within those."""
        return [method for method in self.methods if method in SETTINGS]

    def _check(self) -> None:
        _all_known("--presets", self.presets, tuple(PRESETS))
        _all_known("--methods", self.methods, (*SETTINGS, *METHODS))
        if not self._running() or not self.names or self.seeds < 1:
            raise InputError(
                "A benchmark has a scene, a seed, and a method that is run",
                f"--scenes {' '.join(self.scenes)} --methods {' '.join(self.methods)} "
                f"--seeds {self.seeds}",
                "posed_mesh alone is scored within the runs of another method.",
            )
        for preset in self.presets:
            for method in self._running():
                with_settings(PRESETS[preset](), (*self.settings, *SETTINGS[method]))
        _ = self.waited_for


def _is_folder(scene: str) -> bool:
    return "/" in scene or Path(scene).is_dir()


def _all_known(option: str, given: tuple[str, ...], known: tuple[str, ...]) -> None:
    unknown = [name for name in given if name not in known]
    if unknown or len(set(given)) < len(given):
        raise InputError(
            f"{option} must be different ones of {', '.join(dict.fromkeys(known))}",
            " ".join(unknown or given),
            "Choose from these.",
        )
