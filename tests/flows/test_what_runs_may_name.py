"""No field of a configuration and no parameter of a deployed flow names a file unchecked.

A field that may hold a path is found by its type; text that could be one is listed here, by hand,
with what it is instead.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from prefect.flows import load_flow_from_entrypoint
from pydantic import BaseModel

from flows.allowed_folders import AllowedFolders
from flows.benchmark_request import BenchmarkRequest
from flows.imported_scene import scene_folder
from flows.request import Request
from mocoflow_core.datasets.import_dataset import configure
from mocoflow_core.datasets.kinds import KINDS
from mocoflow_core.errors import InputError
from mocoflow_core.perception import network_file
from mocoflow_core.perception.network_file import FileOfNetwork
from mocoflow_core.presets import Configuration
from mocoflow_core.synthetic.configuration import SyntheticConfig

DEPLOYMENTS = Path(__file__).parents[2] / "deployments" / "prefect.yaml"
PLACES = (Path, FileOfNetwork)

# Names of things that a scene or a data set holds: compared with its own, never opened.
NAMES = {
    "capture.train_camera",
    "train_camera",
    "evaluation_cameras",
    "left_out_views",
    "sequence",
    "name",
}
# Parameters of flows whose text leads nowhere, or is refused by a law of its own.
LEADS_NOWHERE = {
    "until": "a score",
    "settings": "fields of a configuration: each is looked at below",
    "import_settings": "the same",
    "targets": "scores",
    "slots": "a limit of the server",
    "dask": "test_allowed_addresses.py",
    "rendezvous": "test_allowed_addresses.py",
}
LEADS_SOMEWHERE = {"scene", "scenes", "meshes", "out", "store"}  # test_allowed_folders.py


def kinds(annotation: object) -> set[object]:
    """All types that an annotation is made of."""
    parts = get_args(annotation)
    return {kind for part in parts for kind in kinds(part)} if parts else {annotation}


def fields(model: type[BaseModel], above: str = "") -> Iterator[tuple[str, set[object]]]:
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from fields(inner, f"{above}{name}.")
        else:
            yield f"{above}{name}", kinds(inner)


def of_places(model: type[BaseModel]) -> list[str]:
    return [name for name, found in fields(model) if found & set(PLACES)]


MODELS = (Configuration, SyntheticConfig, *(kind.configuration for kind in KINDS.values()))
OF_RUNS = of_places(Configuration)
OF_IMPORTS = [(kind, name) for kind in KINDS.values() for name in of_places(kind.configuration)]


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """A file outside of the roots; a look at it would be noticed."""
    for name in ("films", "results", "home"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("MOCOFLOW_DATA_ROOTS", str(tmp_path / "films"))
    monkeypatch.setenv("MOCOFLOW_RESULTS_ROOT", str(tmp_path / "results"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))

    def looked_at(path):
        raise AssertionError(f"{path} was read")

    monkeypatch.setattr(network_file, "digest_file", looked_at)
    secret = tmp_path / "home" / "secret.onnx"
    secret.write_text("secret")
    return secret


def ways_to(secret: Path) -> list[str]:
    missing = secret.with_name("missing.onnx")
    return [str(secret), str(missing), f"~/{secret.name}", os.path.relpath(secret)]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_field_is_a_place_that_is_checked_or_known_to_be_none(model):
    known = (int, float, bool, type(None), *PLACES)
    for name, found in fields(model):
        odd = {kind for kind in found if isinstance(kind, type) and kind not in known}
        assert not odd or (odd == {str} and name in NAMES), (name, odd)


def test_there_are_fields_of_either_kind():
    assert {"meshes.body_model", "person_scores.lpips", "video.segmenter"} <= set(OF_RUNS)
    assert {"body_model", "annotations", "segmenter"} <= {name for _, name in OF_IMPORTS}


@pytest.mark.parametrize("field", OF_RUNS)
def test_a_run_names_no_file_outside_whether_there_is_one_or_not(field, outside):
    for way in ways_to(outside):
        asked = Request(scene_path="turn", settings=("person_scores.use=off", f"{field}={way}"))
        with pytest.raises(InputError, match=rf"{field} must lie below .*films"):
            _ = asked.configuration


@pytest.mark.parametrize("field", OF_RUNS)
def test_nor_does_a_benchmark(field, outside):
    for way in ways_to(outside):
        asked = BenchmarkRequest(scenes=("turn",), out="b", settings=(f"{field}={way}",))
        with pytest.raises(InputError, match=rf"{field} must lie below .*films"):
            asked.claim()


@pytest.mark.parametrize(
    ("kind", "field"), OF_IMPORTS, ids=lambda value: getattr(value, "name", value)
)
def test_nor_does_the_import_of_a_data_set(kind, field, outside):
    for way in ways_to(outside):
        chosen = configure(kind, (f"{field}={way}",), None)
        with pytest.raises(InputError, match=rf"{field} must lie below .*films"):
            AllowedFolders.of_environment().check_files(chosen)


def test_a_scene_that_is_imported_is_checked_before_its_files_are_read(outside, tmp_path):
    film = tmp_path / "films" / "film.mp4"
    film.write_bytes(b"no film")
    with pytest.raises(InputError, match="segmenter must lie below"):
        scene_folder(film, False, import_settings=(f"segmenter={outside}",))


@pytest.mark.parametrize(
    "record",
    ['{{"name": "{0}", "digest": "0"}}', '{{"path": "{0}", "digest": "0"}}', '{{"name": "{0}"}}'],
)
def test_a_record_of_a_network_leads_to_no_file(record, outside):
    setting = f"person_scores.detector={record.format(outside)}"
    with pytest.raises(InputError, match=r"person_scores\.detector must be valid"):
        _ = Request(scene_path="turn", settings=(setting,)).configuration


def flows():
    deployments = yaml.safe_load(DEPLOYMENTS.read_text())["deployments"]
    entrypoints = {deployment["entrypoint"] for deployment in deployments}
    return sorted({*entrypoints, "flows.plan.plan"})


@pytest.mark.parametrize("entrypoint", flows())
def test_every_parameter_with_room_for_a_path_is_checked_or_known_to_be_none(entrypoint):
    flow = load_flow_from_entrypoint(entrypoint)
    for name, parameter in inspect.signature(flow.fn, eval_str=True).parameters.items():
        if kinds(parameter.annotation) & {str, object, Any, inspect.Parameter.empty, *PLACES}:
            assert name in LEADS_SOMEWHERE or name in LEADS_NOWHERE, name
