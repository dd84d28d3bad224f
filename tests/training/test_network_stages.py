"""The paper's stages on a toy scene with tiny networks."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from mocoflow_core.fields.network_field import NetworksConfig
from mocoflow_core.fields.skip_network import SkipConfig
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.rendering.frame_box import BoxConfig
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.clock import Seconds, TrainingClock
from mocoflow_core.training.fit_points import FitPoints
from mocoflow_core.training.guard import TrainingDiverged
from mocoflow_core.training.loop import TrainingRun
from mocoflow_core.training.mesh_views import MeshViewsConfig, cameras_around
from mocoflow_core.training.network_stages import (
    fit_networks,
    network_problem,
    network_space,
    pretrain_networks,
    require_density,
)
from mocoflow_core.training.optimise_scene import optimise_scene
from mocoflow_core.training.problem import Learned
from mocoflow_core.training.schedule import ScheduleConfig
from tests.toy_training import silent

SMALL = SkipConfig(layers=2, width=16, skip=0)
NETWORKS = NetworksConfig(radiance=SMALL, motion=SMALL, colour_width=8)
BOX = BoxConfig(coarse_samples=8, fine_samples=8)
VIEWS = MeshViewsConfig(views=6, side_px=24)
LOSSES = LossConfig(silhouette_weight=0.0, consensus_points=None, fit_points=64)
SCHEDULE = ScheduleConfig(
    pretrain_steps=12,
    fit_steps=12,
    coarse_steps=6,
    fine_steps=4,
    rays=32,
    frames_per_step=1,
    rate_networks=5e-3,
    rate_motion=5e-3,
    threads=1,
    checkpoint_every_s=1e6,
)


def pretrain(prepared, folder, schedule=SCHEDULE):
    clip = prepared.clip
    stage = schedule.pretraining()
    first = int(clip.frame_indices[0])
    shape = (True, "frame", NETWORKS, BOX, VIEWS)
    return pretrain_networks(clip, prepared.meshes, first, *shape, stage, 0, folder, silent)


def fit(prepared, pretrained, folder, schedule=SCHEDULE, losses=LOSSES):
    stage = schedule.fitting()
    data = (prepared.clip, prepared.meshes, pretrained)
    return fit_networks(*data, Learned(), losses, stage, 0, folder, silent)


@pytest.fixture(scope="module")
def pretrained(prepared, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pretrained")
    pretrain(prepared, folder)
    return folder


@pytest.fixture(scope="module")
def fitted(prepared, pretrained, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fitted")
    fit(prepared, pretrained, folder)
    return folder


def weights(folder) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def changed(before, after) -> set[str]:
    """The networks and codes whose weights differ."""
    moved = {name for name in before if not torch.equal(before[name], after[name])}
    return {name.split(".")[0] for name in moved}


def test_pretraining_trains_the_radiance_networks_alone(prepared, pretrained, tmp_path):
    result = pretrain(prepared, tmp_path, SCHEDULE.model_copy(update={"pretrain_steps": 0}))
    assert result.steps == 0
    assert changed(weights(tmp_path), weights(pretrained)) == {"coarse", "fine"}


def test_fitting_moves_the_motion_and_the_colours_and_leaves_density_as_it_is(pretrained, fitted):
    before, after = weights(pretrained), weights(fitted)
    assert {"canonical_motion", "observed_motion"} <= changed(before, after)
    moved = {name for name in before if not torch.equal(before[name], after[name])}
    assert any(name.startswith("fine.colour_head") for name in moved)
    assert not any("trunk" in n or "density_head" in n for n in moved if "motion" not in n)


def test_fitting_brings_the_motion_to_the_mesh(prepared, pretrained, tmp_path):
    steps = SCHEDULE.model_copy(update={"fit_steps": 150})
    fit(prepared, pretrained, tmp_path, steps)
    clip, meshes = prepared.clip, prepared.meshes
    last = int(clip.frame_indices[~clip.held_out][-1])
    points = torch.from_numpy(meshes.at(np.array([last], np.int32)).vertices[0])
    errors = []
    for folder in (pretrained, tmp_path):
        problem = network_problem(folder, clip, Learned(), LOSSES, 0)
        row = torch.full((len(points),), int((~clip.held_out).sum()) - 1)
        with torch.no_grad():
            moved, _ = problem.scene.to_canonical(points, row)
        goal = torch.from_numpy(problem.space.canonical_vertices)
        errors.append(float((moved - goal).norm(dim=1).mean()))
    assert errors[1] < 0.5 * errors[0]


def test_the_joint_stage_ends_in_a_scene_that_opens_and_renders(prepared, fitted, tmp_path):
    problem = network_problem(fitted, prepared.clip, Learned(), LOSSES, 0)
    result = optimise_scene(
        prepared.clip, problem, SCHEDULE.joint(), 0, Seconds(), tmp_path, silent
    )
    assert result.steps == 10
    assert not result.events
    camera = prepared.clip.camera
    rgb, opacity = TrainedScene.open(tmp_path).render(camera, 0.3)
    assert np.isfinite(rgb).all()
    assert ((opacity >= 0) & (opacity <= 1)).all()
    assert len(TrainedScene.open(tmp_path).space.canonical_vertices)


def test_networks_without_density_on_the_body_stop_in_words(prepared, pretrained):
    problem = network_problem(pretrained, prepared.clip, Learned(), LOSSES, 0)
    vertices = problem.space.canonical_vertices
    require_density(problem.field, vertices)
    with torch.no_grad():
        problem.field.fine.density_head.bias.fill_(-1e3)
    with pytest.raises(TrainingDiverged, match=r"fine.*schedule\.rate_networks"):
        require_density(problem.field, vertices)


def test_the_same_seed_gives_the_same_weights(prepared, pretrained, tmp_path):
    pretrain(prepared, tmp_path)
    assert not changed(weights(pretrained), weights(tmp_path))


def test_a_stage_without_its_input_is_an_error_never_a_start_from_scratch(prepared, tmp_path):
    with pytest.raises(FileNotFoundError):
        network_problem(tmp_path, prepared.clip, Learned(), LOSSES, 0)


def test_what_starts_from_scratch_may_see_its_losses_rise_at_first(prepared, fitted, tmp_path):
    """An empty picture is close to a white wall; the first fog that is learned is not."""
    nothing = SCHEDULE.model_copy(update={"pretrain_steps": 0, "fit_steps": 0})
    pretrain(prepared, tmp_path / "empty", nothing)
    fit(prepared, tmp_path / "empty", tmp_path / "scratch", nothing)
    expected = {}
    for folder in (tmp_path / "scratch", fitted):
        problem = network_problem(folder, prepared.clip, Learned(), LOSSES, 0)
        pixels = TrainingPixels(prepared.clip, problem.scene)
        into = (tmp_path / "run", silent, None, None, TrainingClock())
        run = TrainingRun(problem, pixels, SCHEDULE, 0, Seconds(), *into)
        expected[problem.from_scratch] = run.guard.best
    assert expected[True] == np.inf
    assert expected[False] < 100.0


def test_the_density_is_the_same_function_before_and_after_a_stage(prepared, pretrained, fitted):
    points = torch.rand(200, 3)
    densities = []
    for folder in (pretrained, fitted):
        field = network_problem(folder, prepared.clip, Learned(), LOSSES, 0).field
        with torch.no_grad():
            densities.append(field.density(field.fine, points)[0])
    assert torch.equal(*densities)


def points_to_fit(prepared) -> FitPoints:
    clip = prepared.clip
    space = network_space(
        clip, prepared.meshes, int(clip.frame_indices[0]), True, "frame", NETWORKS, BOX
    )
    rows = ~clip.held_out
    training = prepared.meshes.at(clip.frame_indices[rows])
    boxes = space.boxes.at(torch.from_numpy(clip.times[rows]))
    return FitPoints(training.vertices, training.faces, space.canonical_vertices, boxes, LOSSES)


def test_free_points_lie_in_the_box_off_the_mesh_and_body_points_have_their_partners(prepared):
    points = points_to_fit(prepared)
    generator = torch.Generator().manual_seed(0)
    for row in range(len(points.vertices)):
        drawn = points.draw(row, generator)
        assert len(drawn.observed) == 64
        assert 0 < len(drawn.free) <= 64
        apart = torch.cdist(drawn.free, points.vertices[row]).amin(1)
        # The lattice of distances is coarser than the margin is.
        assert apart.amin() > 0.5 * LOSSES.free_margin_m
        turned = drawn.free @ points.boxes.rotation.T
        assert (turned >= points.boxes.lower[row] - 1e-4).all()
        assert (turned <= points.boxes.upper[row] + 1e-4).all()
        # One of the vertices at that place: capsules touch.
        here = (drawn.observed[:, None] == points.vertices[row]).all(2)
        partners = (drawn.canonical[:, None] == points.canonical).all(2)
        assert (here & partners).any(1).all()


def test_the_views_of_the_mesh_show_all_of_it_from_all_sides(prepared):
    vertices = prepared.meshes.vertices[0]
    cameras = cameras_around(vertices, replace_views(20))
    for camera in cameras:
        at = camera.project(vertices.astype(np.float64))
        assert (at >= 0).all()
        assert (at <= [camera.width, camera.height]).all()
    looking = np.stack([camera.R[2] for camera in cameras])
    assert np.abs(looking.mean(axis=0)).max() < 0.05
    assert np.linalg.eigvalsh(looking.T @ looking / 20).min() > 0.25


def replace_views(count: int) -> MeshViewsConfig:
    return VIEWS.model_copy(update={"views": count})


def test_a_body_that_stands_still_has_no_motion_to_fit(prepared, tmp_path):
    clip = prepared.clip
    first = int(clip.frame_indices[0])
    stage = SCHEDULE.pretraining().without_steps()
    shape = (False, "frame", NETWORKS, BOX, VIEWS)
    pretrain_networks(clip, prepared.meshes, first, *shape, stage, 0, tmp_path / "a", silent)
    fit(prepared, tmp_path / "a", tmp_path / "b", SCHEDULE.model_copy(update={"fit_steps": 2}))
    moved = changed(weights(tmp_path / "a"), weights(tmp_path / "b"))
    assert not moved & {"canonical_motion", "observed_motion"}


def test_a_scene_whose_density_died_says_so(prepared, fitted, tmp_path):
    problem = network_problem(fitted, prepared.clip, Learned(), LOSSES, 0)
    with torch.no_grad():
        problem.field.coarse.density_head.bias.fill_(-1e3)
    stage = SCHEDULE.joint().without_steps()
    result = optimise_scene(prepared.clip, problem, stage, 0, Seconds(), tmp_path, silent)
    assert any("coarse network has no density on 100 %" in words for words in result.warnings)
