"""Each ablation of the paper's networks does what it says, and nothing beside it."""

from __future__ import annotations

import torch
from safetensors.torch import load_file

from mocoflow_core.fields.network_field import NetworksConfig
from mocoflow_core.fields.skip_network import SkipConfig
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.methods.ablations import ABLATIONS
from mocoflow_core.rendering.box_space import BoxSpace
from mocoflow_core.rendering.frame_box import BoxConfig
from mocoflow_core.training.mesh_views import MeshViewsConfig
from mocoflow_core.training.network_stages import fit_networks, network_space, pretrain_networks
from mocoflow_core.training.problem import Learned
from mocoflow_core.training.schedule import ScheduleConfig
from tests.toy_training import Prepared, silent

SMALL = SkipConfig(layers=2, width=16, skip=0)
NETWORKS = NetworksConfig(radiance=SMALL, motion=SMALL, colour_width=8)
SCHEDULE = ScheduleConfig(
    pretrain_steps=2, fit_steps=2, coarse_steps=4, fine_steps=2, rays=16, threads=1
)


def space_of(prepared: Prepared, follows="frame", networks: NetworksConfig = NETWORKS) -> BoxSpace:
    first = int(prepared.clip.frame_indices[0])
    boxes = BoxConfig(coarse_samples=4, fine_samples=4)
    return network_space(prepared.clip, prepared.meshes, first, True, follows, networks, boxes)


def shapes(space: BoxSpace) -> dict[str, torch.Size]:
    return {name: value.shape for name, value in space.build().named_parameters()}


def test_without_box_the_networks_are_the_same_in_one_box_for_all_frames(prepared):
    whole, ablated = space_of(prepared), space_of(prepared, "clip")
    assert ablated.shape == whole.shape
    assert torch.equal(*(torch.from_numpy(s.canonical_vertices) for s in (whole, ablated)))
    assert (ablated.boxes.lower == ablated.boxes.lower[0]).all()
    assert not torch.equal(ablated.boxes.lower, whole.boxes.lower)
    assert (ablated.boxes.lower <= whole.boxes.lower).all()
    assert (ablated.boxes.upper >= whole.boxes.upper).all()


def test_with_ray_direction_the_input_of_the_colour_head_grows_and_nothing_else(prepared):
    sees = {"colour_sees": ABLATIONS["with_ray_direction"].value}
    whole = shapes(space_of(prepared))
    ablated = shapes(space_of(prepared, networks=NETWORKS.model_copy(update=sees)))
    assert whole.keys() == ablated.keys()
    grown = {name for name in whole if whole[name] != ablated[name]}
    assert grown == {"coarse.colour_head.0.weight", "fine.colour_head.0.weight"}
    direction = 3 * (1 + 2 * NETWORKS.direction_bands)
    for name in grown:
        assert ablated[name] == (whole[name][0], whole[name][1] + direction)


def test_without_initialisation_the_joint_stage_starts_from_fresh_weights(prepared, tmp_path):
    clip, meshes, first = prepared.clip, prepared.meshes, int(prepared.clip.frame_indices[0])
    boxes, views = BoxConfig(coarse_samples=4, fine_samples=4), MeshViewsConfig(views=2, side_px=8)
    shape = (True, "frame", NETWORKS, boxes, views)
    begun, fitted = tmp_path / "pretrained", tmp_path / "fitted"
    stage = SCHEDULE.pretraining().without_steps()
    results = [pretrain_networks(clip, meshes, first, *shape, stage, 3, begun, silent)]
    stage = SCHEDULE.fitting().without_steps()
    losses = LossConfig(silhouette_weight=0.0)
    results += [fit_networks(clip, meshes, begun, Learned(), losses, stage, 3, fitted, silent)]
    assert [result.steps for result in results] == [0, 0]
    torch.manual_seed(3)
    fresh = space_of(prepared).build().state_dict()
    left = load_file(fitted / "model.safetensors")
    assert all(torch.equal(left[name], fresh[name]) for name in left)
