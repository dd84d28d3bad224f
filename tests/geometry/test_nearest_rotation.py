from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.geometry.nearest_rotation import nearest_rotation, rotation_by_svd


def blends(spread: float, count: int = 3000):
    """Means of eight rotations that lie ``spread`` radians (rms for each axis) from each other."""
    generator = np.random.default_rng(0)
    weights = generator.dirichlet(np.ones(8), count)
    apart = Rotation.from_rotvec(spread * generator.normal(size=(count * 8, 3))).as_matrix()
    common = Rotation.random(count, rng=generator).as_matrix()
    return np.einsum("nk,nij,nkjl->nil", weights, common, apart.reshape(count, 8, 3, 3))


@pytest.mark.parametrize("spread", [0.0, 1e-3, 0.1, 0.5, 1.0, 3.0])
def test_it_is_what_the_singular_values_say(spread):
    matrices = blends(spread)
    # Where the two largest singular values nearly cancel, the nearest rotation is not unique.
    u, values, vt = np.linalg.svd(matrices)
    gap = values[:, 1] + np.sign(np.linalg.det(u @ vt)) * values[:, 2]
    unique = gap > 1e-3
    assert unique.mean() > 0.95
    apart = np.abs(nearest_rotation(matrices) - rotation_by_svd(matrices)).max(axis=(1, 2))
    assert apart[unique].max() < 1e-11


def test_it_is_a_rotation_even_of_reflections_and_of_nothing():
    hard = np.stack([np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), -np.eye(3), 1e-12 * np.eye(3)])
    found = nearest_rotation(hard)
    assert np.allclose(found @ np.swapaxes(found, -1, -2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(found), 1.0)


@pytest.mark.parametrize("scale", [0.5, 3.0, 1e6])
def test_scale_does_not_matter(scale):
    matrices = blends(0.3, count=50)
    assert np.allclose(nearest_rotation(scale * matrices), nearest_rotation(matrices), atol=1e-12)
