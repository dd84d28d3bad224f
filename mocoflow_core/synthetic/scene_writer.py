"""From a configuration to a native scene folder with exact truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.synthetic.background import render_background
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.clothing import Outfit
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.mesh_estimate import estimate_meshes, root_centred
from mocoflow_core.synthetic.motions import MOTIONS, Motion
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.renderer import FrameRenderer
from mocoflow_core.synthetic.scene_files import SceneFiles
from mocoflow_core.synthetic.surface import Surface
from mocoflow_core.synthetic.texture import encode_srgb
from mocoflow_core.synthetic.topology import body_topology

Progress = Callable[[float, str], None]

_ATTRIBUTION = "Rendered from the Anny body model (NAVER Corp., Apache-2.0; its assets CC0)."


@dataclass(frozen=True, eq=False)
class Performance:
    """What happens in front of the cameras."""

    motion: Motion
    surface: Surface  # what is rendered
    vertices: NDArray[np.float64]  # (T, V, 3) of that surface, world metres
    keypoints3d: NDArray[np.float64]  # (T, 17, 3) COCO joints of the body inside


def write_scene(
    configuration: SyntheticConfig, folder: Path, progress: Progress | None = None
) -> None:
    """Write a scene folder: frames, masks, backgrounds, meshes, truth, scene.json.

    48 frames of 8 cameras at 128 x 128 take about 20 seconds on one core.
    Raises InputError if the folder holds anything already.
    """
    files = SceneFiles(folder)
    person = Person.load(configuration.shape)
    performance = perform(configuration, person)
    cameras = camera_ring(configuration, performance.vertices)
    backgrounds = [
        render_background(camera, configuration.supersampling, configuration.seed)
        for camera in cameras
    ]
    for camera, background in zip(cameras, backgrounds, strict=True):
        files.write_background(camera, encode_srgb(background.light))
    for index, vertices in enumerate(performance.vertices):
        frame = FrameRenderer(performance.surface, vertices, configuration.shadows)
        for camera, background in zip(cameras, backgrounds, strict=True):
            picture = frame.render(camera, background, configuration.supersampling)
            files.write_picture(camera, index, picture.rgb, picture.mask)
        if progress is not None:
            progress((index + 1) / configuration.frames, f"frame {index + 1}")
    meshes = estimate_meshes(configuration, person, performance.motion)
    if not configuration.located:
        meshes = root_centred(meshes, cameras[0], performance.motion.root_position)
    files.write_meshes(meshes)
    files.write_truth(
        meshes.frame_indices,
        performance.vertices,
        performance.surface.faces,
        performance.keypoints3d,
    )
    files.write_description(
        configuration.name, configuration.fps, cameras, configuration.located, _ATTRIBUTION
    )


def perform(configuration: SyntheticConfig, person: Person) -> Performance:
    """Pose and clothe the person over the clip, its lowest point on the floor in every frame."""
    times = np.linspace(0, 1, configuration.frames)
    outfit = Outfit(person, configuration.seed)
    topology = body_topology(person)
    surface = Surface(
        topology.mixture @ person.rest_vertices.astype(np.float32),
        topology.faces,
        outfit.face_limbs,
        outfit.albedo,
    )
    motion = MOTIONS[configuration.motion](times)
    body = person.pose(motion)
    lift = -topology.vertices(body)[..., 2].min(axis=1)
    body[..., 2] += lift[:, None]
    motion = replace(motion, root_position=motion.root_position + lift[:, None] * [0.0, 0.0, 1.0])
    vertices = topology.vertices(body)
    if configuration.clothing == "loose":
        for frame, time in enumerate(times):
            stand_off = topology.mixture @ outfit.stand_off(time)
            vertices[frame] += stand_off[:, None] * surface.normals(vertices[frame])
    keypoints = np.einsum("kv,tvd->tkd", person.keypoint_regressor, body)
    return Performance(motion, surface, vertices, keypoints)
