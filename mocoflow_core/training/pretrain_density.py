"""Stage 1: the canonical density, started from the canonical mesh.

The fast representation needs no images of the mesh for this: its density is a function of a signed
distance, and the mesh's own signed distance is known in closed form.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.canonical_density import CanonicalDensity


class DensityConfig(ConfigurationPart):
    """The lattice of the canonical mesh's signed distance."""

    spacing_m: float = Field(0.02, gt=0)
    margin_m: float = Field(0.25, gt=0, description="how far it reaches beyond the mesh")


def pretrain_density(
    meshes: MeshSequence, canonical_frame: int, configuration: DensityConfig
) -> CanonicalDensity:
    """Density of the mesh at the canonical frame (a source frame number).

    Source: MoCo-Flow sec. 3.4, first stage.
    """
    vertices = meshes.at(np.array([canonical_frame], np.int32)).vertices[0]
    origin, lattice = signed_distance_lattice(
        vertices, meshes.faces, configuration.spacing_m, configuration.margin_m
    )
    return CanonicalDensity(vertices, meshes.faces, lattice, origin, configuration.spacing_m)
