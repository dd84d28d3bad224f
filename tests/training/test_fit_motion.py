from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.training.fit_motion import MotionStart, fit_motion
from mocoflow_core.training.pretrain_density import DensityConfig, pretrain_density
from tests.toy_training import MOTION, SHELL_M


def test_the_motion_starts_at_the_mesh_s_own(prepared):
    fit = prepared.motion.fit
    # Limbs swing by 25 degrees about joints that are 0.06 wide; the lattice has 0.04.
    assert fit.to_canonical_mm < 2
    assert fit.to_observed_mm < 2
    assert fit.round_trip_mm < 1


def test_training_frames_alone_have_look_up_tables(prepared):
    clip = prepared.clip
    assert prepared.motion.body.times.tolist() == clip.times[~clip.held_out].tolist()
    assert prepared.motion.controls.times.tolist() == clip.times.tolist()


def test_the_saved_motion_is_the_same_motion(prepared, tmp_path):
    prepared.motion.save(tmp_path)
    loaded = MotionStart.load(tmp_path)
    assert loaded.fit == prepared.motion.fit
    assert np.array_equal(loaded.controls.observed, prepared.motion.controls.observed)
    ours, theirs = prepared.motion.body.tensors(), loaded.body.tensors()
    assert ours.keys() == theirs.keys()
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)


def test_meshes_are_joined_by_frame_number_not_by_row(prepared):
    # The meshes of a longer recording, whose first rows belong to no frame of the clip.
    meshes = prepared.meshes
    padded = type(meshes)(
        np.arange(-2, len(meshes.frame_indices), dtype=np.int32),
        np.concatenate([meshes.vertices[:2] + 5.0, meshes.vertices]),
        meshes.faces,
        meshes.keypoint_regressor,
    )
    again = fit_motion(prepared.clip, padded, prepared.density, SHELL_M, True, MOTION)
    assert np.array_equal(again.controls.observed, prepared.motion.controls.observed)


def test_every_frame_is_told_and_nothing_changes_by_it(prepared):
    said = []
    given = (prepared.clip, prepared.meshes, prepared.density, SHELL_M, True, MOTION)
    told = fit_motion(*given, lambda fraction, text: said.append(fraction))
    assert said == sorted(said)
    assert len(said) == 2 * (~prepared.clip.held_out).sum()
    assert said[-1] == pytest.approx(1.0)
    assert told.fit == prepared.motion.fit


def test_the_canonical_density_is_that_of_the_asked_frame(prepared):
    meshes = prepared.meshes
    frame = int(meshes.frame_indices[3])
    density = pretrain_density(meshes, frame, DensityConfig(spacing_m=0.03))
    assert np.array_equal(density.vertices, meshes.vertices[3])
    on_surface = density.prior()(torch.from_numpy(meshes.vertices[3]))
    # Linear between lattice points, rounded off at thin limbs.
    assert float(on_surface.abs().median()) < 0.005
    inside = density.prior()(torch.from_numpy(meshes.vertices[3].mean(0, keepdims=True)))
    assert float(inside) == pytest.approx(-0.12, abs=0.05)


def test_the_saved_density_is_the_same_density(prepared, tmp_path):
    prepared.density.save(tmp_path)
    loaded = CanonicalDensity.load(tmp_path)
    for name in ("vertices", "faces", "lattice", "origin"):
        assert np.array_equal(getattr(loaded, name), getattr(prepared.density, name))
    assert loaded.spacing == prepared.density.spacing


def test_a_body_that_stands_still_has_one_table_that_serves_every_frame(prepared):
    clip = prepared.clip
    still = fit_motion(clip, prepared.meshes, prepared.density, SHELL_M, False, MOTION)
    body, count = still.body, int((~clip.held_out).sum())
    assert body.times.tolist() == prepared.motion.body.times.tolist()
    assert body.observed_grids.count == count
    # Lattices of single frames differ in size by how far the limbs are spread.
    assert len(body.observed_maps) < 1.5 / count * len(prepared.motion.body.observed_maps)
    points = torch.from_numpy(prepared.density.vertices)
    for row in range(count):
        frame = torch.full((len(points),), row)
        for moved, known in (body.to_canonical(points, frame), body.to_observed(points, frame)):
            assert known.all()
            # The identity up to the rounding of float32 metres.
            assert torch.allclose(moved, points, atol=1e-5)
    assert still.fit.to_canonical_mm < 0.01


def test_the_shared_tables_survive_being_saved(prepared, tmp_path):
    start = fit_motion(prepared.clip, prepared.meshes, prepared.density, SHELL_M, False, MOTION)
    start.save(tmp_path)
    ours, theirs = start.body.tensors(), MotionStart.load(tmp_path).body.tensors()
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)
