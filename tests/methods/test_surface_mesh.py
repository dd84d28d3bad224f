"""Surfaces of scenes whose shape is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import torch
import trimesh

from mocoflow_core.errors import InputError
from mocoflow_core.methods import surface_mesh as module
from mocoflow_core.methods.surface_mesh import surface_mesh

RADIUS = 0.3
SPACING = 0.02


@dataclass
class Balls:
    """Solid balls with a soft edge; colours are places, darker where looked at along +x."""

    balls: tuple = (((0.0, 0.0, 0.0), RADIUS),)
    hollow_m: float = 0.0  # radius of an empty middle
    surface_density: float = 80.0
    box: tuple = (np.full(3, -0.5), np.full(3, 0.5))
    asked: int = 0

    def density(self, points):
        self.asked += len(points)
        centres = torch.tensor([centre for centre, _ in self.balls])
        radii = torch.tensor([radius for _, radius in self.balls])
        distance = ((points[:, None] - centres).norm(dim=-1) - radii).amin(1)
        distance = torch.maximum(distance, self.hollow_m - points.norm(dim=-1))
        return 2 * self.surface_density * torch.sigmoid(-distance / 0.003)

    def colour(self, points, looking):
        return torch.cat([points[:, 1:] + 0.5, (looking[:, :1] + 1) / 2], 1)


def as_trimesh(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_vertices_lie_on_the_level_however_steep_the_density_is():
    mesh = surface_mesh(Balls(), SPACING)
    off = np.linalg.norm(mesh.vertices, axis=1) - RADIUS
    assert np.abs(off).max() < 0.02 * SPACING


def test_the_surface_is_closed_winds_outward_and_has_its_area():
    solid = as_trimesh(surface_mesh(Balls(), SPACING))
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
    assert solid.area == pytest.approx(4 * np.pi * RADIUS**2, rel=0.01)


def test_colours_are_those_of_the_surface_seen_from_straight_above():
    mesh = surface_mesh(Balls(), SPACING)
    assert mesh.colours[:, :2] == pytest.approx(mesh.vertices[:, 1:] + 0.5, abs=1e-5)
    inward = -mesh.vertices[:, 0] / RADIUS
    assert mesh.colours[:, 2] == pytest.approx((inward + 1) / 2, abs=0.05)


def test_what_floats_beside_the_body_is_left_out_and_counted():
    crumbs = (((0.38, 0.38, -0.02), 0.025), ((-0.38, 0.02, 0.38), 0.028))
    mesh = surface_mesh(Balls((((0.0, 0.0, 0.0), RADIUS), *crumbs)), SPACING)
    assert mesh.floating == 2
    assert np.linalg.norm(mesh.vertices, axis=1).max() < RADIUS + SPACING
    assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))


def test_a_second_large_part_is_kept():
    mesh = surface_mesh(Balls((((-0.2, 0.0, 0.0), 0.2), ((0.3, 0.0, 0.0), 0.15))), SPACING)
    assert mesh.floating == 0
    assert as_trimesh(mesh).body_count == 2


def test_hollows_that_nobody_can_see_have_no_surface():
    solid = as_trimesh(surface_mesh(Balls(hollow_m=0.15), SPACING))
    assert solid.body_count == 1
    assert solid.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)


def test_a_body_that_the_box_cuts_is_closed_at_the_cut():
    solid = as_trimesh(surface_mesh(Balls((((0.0, 0.0, 0.45), RADIUS),)), SPACING))
    assert solid.is_watertight
    assert solid.bounds[1, 2] == pytest.approx(0.5, abs=SPACING)


def test_a_thin_limb_between_the_coarse_points_is_followed_to_its_end():
    # Coarse points lie at even lattice points: the chain of beads runs along odd ones.
    beads = tuple(((0.01, 0.01, 0.25 + 0.005 * k), 0.012) for k in range(40))
    mesh = surface_mesh(Balls((((0.0, 0.0, 0.0), RADIUS), *beads)), 0.01)
    assert mesh.floating == 0
    assert mesh.vertices[:, 2].max() == pytest.approx(0.25 + 0.005 * 39 + 0.012, abs=0.002)


def test_most_of_empty_space_is_never_asked():
    scene = Balls()
    surface_mesh(scene, 0.01)
    assert scene.asked < 0.6 * 101**3


def test_a_scene_without_a_surface_says_how_dense_it_is():
    with pytest.raises(InputError, match="at most 0 /m"):
        surface_mesh(Balls((((0.0, 0.0, 9.0), 0.1),)), SPACING)


def test_a_lattice_that_is_too_fine_is_refused_before_it_is_made(monkeypatch):
    monkeypatch.setattr(module, "MOST_LATTICE_POINTS", 10_000)
    scene = Balls()
    with pytest.raises(InputError, match=r"Try 0\.047"):
        surface_mesh(scene, 0.01)
    assert scene.asked == 0
