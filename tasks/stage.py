"""A cached stage: one Prefect task whose cache key is the content key of what it computes.

The store is the truth. Prefect is told to compute again whatever the store does not hold intact,
and shows the rest as ``Cached``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from prefect import Task
from prefect.cache_policies import CachePolicy
from pydantic import JsonValue

from mocoflow_core.artifacts import Artifact
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.io.content_key import key_of
from mocoflow_core.io.store import Store
from tasks.progress import Progress, showing_progress
from tasks.source import Source

Inputs = ParamSpec("Inputs")
Kind = TypeVar("Kind", bound=Artifact)
Summary = Mapping[str, JsonValue]
Body = Callable[Concatenate["Stage", Inputs], Summary]
Staged = Callable[Concatenate[Store, Inputs], Kind]


@dataclass(frozen=True)
class Stage:
    """What the body of a stage works with: a folder to fill and a way to open its inputs."""

    folder: Path
    progress: Progress
    store: Store

    def open(self, artifact: Artifact) -> Path:
        """The folder with an input's payload files."""
        return self.store.folder(artifact)


def stage(
    kind: type[Kind], version: int, *, resumes: bool = False
) -> Callable[[Body[Inputs]], Staged[Inputs, Kind]]:
    """Turn a body that fills a folder into a task that is called with the store.

    Every argument counts in the key: artifacts and sources by content, the rest by value. With
    ``resumes`` the folder of a killed try is handed to the next one.
    """

    def decorate(body: Body[Inputs]) -> Staged[Inputs, Kind]:
        def run(store: Store, arguments: dict[str, Any]) -> Kind:
            parts = _by_content(arguments)
            with store.computing(
                kind, key_of(kind.stage, version, *parts), resumes=resumes
            ) as work:
                if work.found:
                    return work.found
                with showing_progress(kind.stage, work.note_time) as progress:
                    summary = body(Stage(work.path, progress, store), **arguments)
                return work.commit(version, *parts, summary)

        policy = CachePolicy.from_cache_key_fn(
            lambda _, given: key_of(kind.stage, version, *_by_content(given["arguments"]))
        )
        task = Task(
            run,
            name=kind.stage,
            task_run_name=kind.stage,
            description=inspect.getdoc(body),
            cache_policy=policy,
            persist_result=True,
            result_serializer="json",
        )

        @wraps(body)
        def call(store: Store, *args: Inputs.args, **kwargs: Inputs.kwargs) -> Kind:
            _, *names = inspect.signature(body).parameters
            arguments = dict(zip(names, args, strict=False)) | kwargs
            found = store.find(kind, key_of(kind.stage, version, *_by_content(arguments)))
            outcome = task.with_options(refresh_cache=found is None)(store, arguments)
            return found or outcome

        return call

    return decorate


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
        else:
            values[name] = value
    return inputs, values
