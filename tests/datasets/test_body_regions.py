"""Regions around a body in a picture contain each other and follow its silhouette."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.datasets.body_regions import BodyRegions
from tests.datasets.studio import Y_UP, studio


@pytest.mark.parametrize(("width", "height"), [(64, 96), (500, 750)])
def test_inside_lies_in_the_body_and_the_body_near_it(width, height):
    filmed = studio(("c01",), Y_UP, width=width, height=height, frames=2)
    region = BodyRegions(filmed.meshes, filmed.cameras["c01"]).at(1)
    wanted = filmed.masks["c01"][1]
    assert not (region.inside & ~region.on).any()
    assert not (region.on & ~region.near).any()
    assert not (wanted & ~region.near).any()
    assert np.logical_xor(region.on, wanted).sum() < 0.1 * wanted.sum()
    assert region.inside.sum() < region.on.sum() < region.near.sum()
