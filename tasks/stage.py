"""A cached stage: one Prefect task whose cache key is the content key of what it computes.

The store is the truth. Prefect is told to compute again whatever the store does not hold intact,
and shows the rest as ``Cached``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

from prefect import Task, get_run_logger
from prefect.cache_policies import CachePolicy
from prefect.context import FlowRunContext, TaskRunContext
from pydantic import JsonValue

from mocoflow_core.artifacts import Artifact
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.io.content_key import key_of
from mocoflow_core.io.store import Store
from mocoflow_core.progress import Progress, part_of
from mocoflow_core.threads import torch_threads
from tasks.progress import showing_progress
from tasks.source import Source
from tasks.terminal_bar import terminal_line

Inputs = ParamSpec("Inputs")
Kind = TypeVar("Kind", bound=Artifact)
Summary = Mapping[str, JsonValue]
Body = Callable[Concatenate["Stage", Inputs], Summary]


@dataclass(frozen=True)
class Aside:
    """Facts that a stage passes on to people and that decide nothing: they stay out of the key."""

    values: Mapping[str, JsonValue]


@dataclass(frozen=True)
class Stage:
    """What the body of a stage works with: a folder to fill and a way to open its inputs."""

    folder: Path
    progress: Progress
    store: Store
    leave_out: Callable[[float, float], None]  # wall and CPU seconds that were no work on it
    log: Callable[[str], None]  # a line for people

    def open(self, artifact: Artifact) -> Path:
        """The folder with an input's payload files."""
        return self.store.folder(artifact)

    def part(self, start: float, end: float) -> Progress:
        """Progress of a part of the stage that spans these fractions of the whole."""
        return part_of(self.progress, start, end)


@dataclass(frozen=True, eq=False)
class CachedStage(Generic[Inputs, Kind]):
    """A body that fills a folder, called with the store that the folder belongs to.

    Every argument counts in the key: artifacts and sources by content, the rest by value, but
    an ``Aside`` not at all. With
    ``resumes`` the folder of a killed try is handed to the next one.
    """

    kind: type[Kind]
    version: int
    resumes: bool
    body: Body[Inputs]

    def __call__(self, store: Store, *args: Inputs.args, **kwargs: Inputs.kwargs) -> Kind:
        _, *names = inspect.signature(self.body).parameters
        arguments = dict(zip(names, args, strict=False)) | kwargs
        key = self._key(arguments)
        found = store.find(self.kind, key)
        if found is None and (fault := store.fault(self.kind, key)):
            _tell(f"{self.kind.stage}/{key} is damaged and computed again: {fault}")
        computed = self.task.with_options(refresh_cache=found is None)(store, arguments)
        return found or computed

    @cached_property
    def task(self) -> Task[..., Kind]:
        """The stage as Prefect sees it."""
        return Task(
            self._run,
            name=self.kind.stage,
            task_run_name=self.kind.stage,
            description=inspect.getdoc(self.body),
            cache_policy=CachePolicy.from_cache_key_fn(
                lambda _, given: self._key(given["arguments"])
            ),
            persist_result=True,
            result_serializer="json",
        )

    def _run(self, store: Store, arguments: dict[str, Any]) -> Kind:
        with store.computing(self.kind, self._key(arguments), resumes=self.resumes) as work:
            if work.found:
                return work.found
            # More than one thread only where a stage has measured that it pays.
            with torch_threads(1), showing_progress(self.kind.stage, work.note_time) as progress:
                stage = Stage(work.path, progress, store, work.leave_out, _tell)
                summary = self.body(stage, **arguments)  # type: ignore
            made = work.commit(self.version, *_by_content(arguments), summary)
        _log(made)
        return made

    def _key(self, arguments: Mapping[str, Any]) -> str:
        return key_of(self.kind.stage, self.version, *_by_content(arguments))


def _tell(line: str) -> None:
    """In a terminal, and on the run's page."""
    terminal_line(line)
    if TaskRunContext.get() or FlowRunContext.get():
        get_run_logger().info(line)


def _log(made: Artifact) -> None:
    """What a stage has cost and where it lies, on the run's page."""
    if TaskRunContext.get():
        took = f"{made.wall_s:.1f} s, {made.cpu_s:.1f} CPU s"
        get_run_logger().info(f"{made.stage} took {took}: {made.stage}/{made.key}")
        for warning in made.warnings:
            get_run_logger().warning(warning)


def stage(
    kind: type[Kind], version: int, *, resumes: bool = False
) -> Callable[[Body[Inputs]], CachedStage[Inputs, Kind]]:
    """Decorate the body of a stage."""
    return lambda body: CachedStage(kind, version, resumes, body)


def _by_content(arguments: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, JsonValue]]:
    """The inputs' keys and digests, and the values of everything else."""
    inputs: dict[str, str] = {}
    values: dict[str, JsonValue] = {}
    for name, value in arguments.items():
        if isinstance(value, Artifact):
            inputs[name] = value.key
        elif isinstance(value, Source):
            inputs[name] = value.digest
        elif isinstance(value, ConfigurationPart):
            values[name] = value.model_dump(mode="json")
        elif not isinstance(value, Aside):
            values[name] = value
    return inputs, values
