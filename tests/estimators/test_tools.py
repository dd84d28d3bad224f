"""One body in every tool's layout comes back with the same vertices at the same place."""

from __future__ import annotations

import numpy as np
import pytest

from tests.estimators import layouts
from tests.estimators.layouts import Person


def in_camera(estimate):
    """Vertices in the train camera's axes, placed as the estimate says."""
    if estimate.coordinates == "camera-root-centred":
        return estimate.vertices + estimate.first_translations[:, None]
    return estimate.vertices


def vibe(person, folder):
    return layouts.write_people(folder / "vibe_output.pkl", {1: layouts.vibe_record(person)})


def pare(person, folder):
    return layouts.write_people(folder / "pare_output.pkl", {1: layouts.pare_record(person)})


def wham(person, folder):
    return layouts.write_wham(folder / "wham_output.pkl", {0: layouts.wham_record(person)})


def wham_api(person, folder):
    return layouts.write_wham(folder / "results.pkl", {0: layouts.wham_api_record(person)})


def phalp(person, folder):
    frames = layouts.phalp_frames({3: person})
    return layouts.write_people(folder / "demo_v.pkl", frames, compress=3)


def tram_folder(person, folder):
    return layouts.write_tram(folder / "v", [person])


def tram_track(person, folder):
    path = folder / "hps_track_0.npy"
    return layouts.write_tram_track(path, person, focal_px=np.sqrt(np.prod(layouts.FOCAL_PX)))


def romp(person, folder):
    frames = {row: layouts.romp_people([person], row) for row in range(len(person))}
    return layouts.write_romp(folder / "romp", frames)


def romp_without_meshes(person, folder):
    frames = {row: layouts.romp_people([person], row, meshes=False) for row in range(len(person))}
    return layouts.write_romp(folder / "romp", frames)


def romp_video(person, folder):
    frames = {row: layouts.romp_people([person], row) for row in range(len(person))}
    return layouts.write_romp(folder / "romp", frames, video=True) / "video_results.npz"


def bev(person, folder):
    frames = {row: layouts.romp_people([person], row, bev=True) for row in range(len(person))}
    return layouts.write_romp(folder / "bev", frames)


WRITERS = {
    vibe: ("VIBE", "camera-root-centred"),
    pare: ("PARE", "camera-root-centred"),
    wham: ("WHAM", "camera"),
    wham_api: ("WHAM", "camera"),
    phalp: ("PHALP", "camera-root-centred"),
    tram_folder: ("TRAM", "camera"),
    romp: ("ROMP", "camera-root-centred"),
    romp_without_meshes: ("ROMP", "camera-root-centred"),
    romp_video: ("ROMP", "camera-root-centred"),
    bev: ("BEV", "camera-root-centred"),
}


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_every_tool_gives_the_same_body_at_the_same_place(
    write, person, read, smpl, smpl_file, tmp_path
):
    estimate = read(write(person, tmp_path), body_model=smpl_file)
    assert (estimate.source, estimate.coordinates) == WRITERS[write]
    assert not estimate.located
    assert np.array_equal(estimate.faces, smpl.faces)
    assert estimate.frame_indices[0] == (1 if write is phalp else 0)
    assert np.allclose(in_camera(estimate), person.vertices, atol=2e-4)


@pytest.mark.parametrize("write", [vibe, wham, wham_api, romp, bev], ids=lambda w: w.__name__)
def test_vertices_need_faces_alone(write, person, read, faces_file, tmp_path):
    estimate = read(write(person, tmp_path), faces=faces_file)
    assert np.allclose(in_camera(estimate), person.vertices, atol=2e-4)


def test_gvhmr_gives_a_smplx_body_at_its_place(smplx, smplx_file, read, tmp_path):
    person = Person.of(smplx)
    person.pose[:, 22:] = 0  # GVHMR has neither face nor hands.
    path = layouts.write_gvhmr(tmp_path / "hmr4d_results.pt", person)
    estimate = read(path, body_model=smplx_file)
    assert (estimate.source, estimate.coordinates, estimate.located) == ("GVHMR", "camera", False)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)


@pytest.mark.parametrize("write", [layouts.write_zju, layouts.write_easymocap])
def test_easymocap_turns_about_the_worlds_origin(write, person, read, smpl_file, tmp_path):
    path = write(tmp_path / "new_params", layouts.easymocap_frames(person))
    estimate = read(path, body_model=smpl_file)
    assert (estimate.coordinates, estimate.located) == ("world", True)
    assert estimate.numbering == "source"
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-5)
