"""Films a performance from all cameras into a native scene folder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.progress import Progress
from mocoflow_core.synthetic.background import render_background
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.configuration import RecordingConfig
from mocoflow_core.synthetic.renderer import FrameRenderer
from mocoflow_core.synthetic.scene_files import SceneFiles
from mocoflow_core.synthetic.surface import Surface
from mocoflow_core.synthetic.texture import encode_srgb


@dataclass(frozen=True, eq=False)
class Performance:
    """What happens in front of the cameras, world metres."""

    surface: Surface  # what is rendered
    vertices: NDArray[np.float64]  # (T, V, 3) of that surface
    keypoints3d: NDArray[np.float64]  # (T, 17, 3) COCO joints of the body inside
    root_position: NDArray[np.float64]  # (T, 3) of the root joint


def record_scene(
    performance: Performance,
    meshes: MeshSequence,
    configuration: RecordingConfig,
    files: SceneFiles,
    attribution: str,
    progress: Progress | None = None,
) -> None:
    """Write everything of a scene; ``meshes`` is the estimate in world metres."""
    cameras = camera_ring(configuration, performance.vertices)
    _film(performance, cameras, configuration, files, progress)
    if not configuration.located:
        meshes = root_centred(meshes, cameras[0], performance.root_position)
    files.write_meshes(meshes)
    files.write_truth(
        meshes.frame_indices,
        performance.vertices,
        performance.surface.faces,
        performance.keypoints3d,
    )
    files.write_description(
        configuration.name, configuration.fps, cameras, configuration.located, attribution
    )


def root_centred(
    meshes: MeshSequence, camera: Camera, root_position: NDArray[np.float64]
) -> MeshSequence:
    """The meshes in the camera's axes with the root joint (T, 3) at the origin of each frame."""
    centred = (meshes.vertices - root_position[:, None]) @ camera.R.T
    return replace(meshes, vertices=centred.astype(np.float32))


def _film(
    performance: Performance,
    cameras: list[Camera],
    configuration: RecordingConfig,
    files: SceneFiles,
    progress: Progress | None,
) -> None:
    samples = configuration.supersampling
    backgrounds = [render_background(camera, samples, configuration.seed) for camera in cameras]
    for camera, background in zip(cameras, backgrounds, strict=True):
        files.write_background(camera, encode_srgb(background.light))
    count = len(performance.vertices)
    for index, vertices in enumerate(performance.vertices):
        frame = FrameRenderer(performance.surface, vertices, configuration.shadows)
        for camera, background in zip(cameras, backgrounds, strict=True):
            picture = frame.render(camera, background, samples)
            files.write_picture(camera, index, picture.rgb, picture.mask)
        if progress is not None:
            progress((index + 1) / count, f"frame {index + 1} of {count}")
