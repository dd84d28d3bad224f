"""From a configuration to a native scene folder with exact truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mocoflow_core.progress import Progress
from mocoflow_core.synthetic.clothing import Outfit
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.mesh_estimate import estimate_meshes
from mocoflow_core.synthetic.motions import MOTIONS, Motion
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.recording import Performance, record_scene
from mocoflow_core.synthetic.scene_files import SceneFiles
from mocoflow_core.synthetic.surface import Surface
from mocoflow_core.synthetic.topology import Topology, body_topology

_ATTRIBUTION = "Rendered from the Anny body model (NAVER Corp., Apache-2.0; its assets CC0)."


def write_scene(
    configuration: SyntheticConfig, folder: Path, progress: Progress | None = None
) -> None:
    """Write a scene folder: frames, masks, backgrounds, meshes, truth, scene.json.

    48 frames of 8 cameras at 128 x 128 take about 20 seconds on one core.
    Raises InputError if the folder holds anything already.
    """
    files = SceneFiles(folder)
    person = Person.load(configuration.shape)
    motion, performance = perform(configuration, person)
    meshes = estimate_meshes(configuration, person, motion)
    record_scene(performance, meshes, configuration, files, _ATTRIBUTION, progress)


def perform(configuration: SyntheticConfig, person: Person) -> tuple[Motion, Performance]:
    """Pose and clothe the person over the clip, its lowest point on the floor in every frame."""
    times = np.linspace(0, 1, configuration.frames)
    topology = body_topology(person)
    motion = MOTIONS[configuration.motion](times)
    body = person.pose(motion)
    lift = -topology.vertices(body)[..., 2].min(axis=1)[:, None] * [0.0, 0.0, 1.0]
    body = body + lift[:, None]
    motion = replace(motion, root_position=motion.root_position + lift)
    outfit = Outfit(person, configuration.seed)
    surface = _surface(person, outfit, topology)
    vertices = topology.vertices(body)
    if configuration.clothing == "loose":
        for frame, time in enumerate(times):
            stand_off = topology.mixture @ outfit.stand_off(time)
            vertices[frame] += stand_off[:, None] * surface.normals(vertices[frame])
    keypoints = np.einsum("kv,tvd->tkd", person.keypoint_regressor, body)
    return motion, Performance(surface, vertices, keypoints, motion.root_position)


def _surface(person: Person, outfit: Outfit, topology: Topology) -> Surface:
    rest = (topology.mixture @ person.rest_vertices).astype(np.float32)
    return Surface(rest, topology.faces, outfit.face_limbs, outfit.albedo)
