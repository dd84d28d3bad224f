"""Whatever is damaged in a tool's file, it is bad input with one line, or it does no harm."""

from __future__ import annotations

import io
import resource
import zipfile
from contextlib import suppress

import numpy as np
import pytest
import torch

from mocoflow_core.errors import InputError
from tests.estimators import layouts
from tests.estimators.layouts import Person

DAMAGES = {
    "none": lambda value: None,
    "text": lambda value: "text",
    "number": lambda value: 3.0,
    "empty": lambda value: np.zeros((0, 3)),
    "shorter": lambda value: value[:-1],
    "no_axes": lambda value: np.array(1.0),
    "unknown": lambda value: np.asarray(value) * np.nan,
    "huge": lambda value: np.asarray(value) * 1e30,
    "nested": lambda value: {"a": {"b": value}},
    "ragged": lambda value: [[1.0], [1.0, 2.0]],
}


def write(kind, record, folder):
    if kind == "romp":
        return layouts.write_romp(folder / "romp", {0: record, 1: record})
    if kind == "easymocap":
        return layouts.write_zju(folder / "params", [record, record])
    if kind == "tram":
        np.save(folder / "hps_track_0.npy", record, allow_pickle=True)
        return folder / "hps_track_0.npy"
    content = record if kind in ("aist_motion", "gvhmr") else {1: record}
    if kind == "phalp":
        content = {"000001.jpg": record, "000002.jpg": record}
    return layouts.write_people(folder / "estimate.pkl", content)


def record_of(kind, smpl, smplx, folder):
    person = Person.of(smpl, frames=2)
    match kind:
        case "phalp":
            [_, frame, _] = layouts.phalp_frames({1: person}).values()
            frame.pop("time")
            return frame
        case "romp":
            return layouts.romp_people([person], 0)
        case "easymocap":
            return layouts.easymocap_frames(person)[0]
        case "tram":
            path = layouts.write_tram_track(folder / "whole.npy", person)
            tensors = np.load(path, allow_pickle=True).item()
            return {name: tensor.numpy() for name, tensor in tensors.items()}
        case "gvhmr":
            path = layouts.write_gvhmr(folder / "whole.pt", Person.of(smplx, frames=2))
            tensors = torch.load(path, weights_only=True)["smpl_params_incam"]
            inside = {name: tensor.numpy() for name, tensor in tensors.items()}
            return {"smpl_params_incam": inside, "K_fullimg": np.tile(layouts.K, (2, 1, 1))}
        case "aist_motion":
            return layouts.aist_motion(person)
        case "vibe":
            return layouts.vibe_record(person)
        case _:
            return layouts.wham_record(person)


def damages_of(record):
    """The record with one part damaged, in every way that this part can be."""
    for part, value in record.items():
        for damage in DAMAGES.values():
            with suppress(TypeError):
                yield record | {part: damage(value)}
    for part, value in record.get("smpl_params_incam", {}).items():
        for damage in DAMAGES.values():
            inner = record["smpl_params_incam"] | {part: damage(value)}
            yield record | {"smpl_params_incam": inner}


KINDS = ["vibe", "wham", "phalp", "gvhmr", "tram", "romp", "aist_motion", "easymocap"]


def test_a_ragged_pose_is_bad_input_before_the_kind_is_known(smpl, smplx, read, tmp_path):
    record = record_of("vibe", smpl, smplx, tmp_path) | {"pose": [[1.0], [1.0, 2.0]]}
    with pytest.raises(InputError, match=r"one of the known tools.*other arrays"):
        read(write("vibe", record, tmp_path))


def npz(tmp_path, compression=zipfile.ZIP_STORED, **contents):
    with zipfile.ZipFile(tmp_path / "meshes.npz", "w", compression) as archive:
        for name, content in contents.items():
            archive.writestr(f"{name}.npy", content)
    return tmp_path / "meshes.npz"


@pytest.mark.parametrize("kind", ["auto", "native"])
def test_our_own_mesh_files_are_as_strange_as_any(kind, read, tmp_path):
    array = io.BytesIO()
    np.save(array, np.zeros((2, 4, 3), np.float32))
    vast = array.getvalue().replace(b"(2, 4, 3)", b"(9999999999999, 4, 3)")
    bomb = array.getvalue() + bytes(2**28)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for content in (vast, bomb):
        path = npz(tmp_path, zipfile.ZIP_DEFLATED, vertices=content)
        with pytest.raises(InputError):
            read(path, kind=kind)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**28 // 1024


@pytest.mark.parametrize("kind", KINDS)
def test_no_damage_to_any_part_is_anything_but_bad_input(
    kind, smpl, smplx, smpl_file, smplx_file, read, tmp_path
):
    model = smplx_file if kind == "gvhmr" else smpl_file
    refusals = []
    for number, damaged in enumerate(damages_of(record_of(kind, smpl, smplx, tmp_path))):
        folder = tmp_path / str(number)
        folder.mkdir()
        try:
            read(write(kind, damaged, folder), kind=kind, body_model=model)
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 5
    assert not any("\n" in refusal for refusal in refusals)
