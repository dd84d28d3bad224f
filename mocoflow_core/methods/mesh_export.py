"""A finished run as meshes for other programs: the canonical surface, and its poses.

The canonical surface is extracted once and carried to every frame by ``to_observed``, so that a
vertex is the same point of the body in all of them. Where body parts touch in the canonical frame
their surfaces are one, which stretches when they part.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict
from scipy.spatial import cKDTree

from mocoflow_core.errors import InputError
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.glb import AnimatedMesh, write_glb
from mocoflow_core.io.pictures import as_bytes
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.io.whole_file import whole_file
from mocoflow_core.methods.run_clip import RunClip
from mocoflow_core.methods.surface_mesh import Points, SurfaceMesh, surface_mesh
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.posed_scene import PosedScene
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.threads import torch_threads

FORMATS = ("glb", "ply")


class MeshRequest(BaseModel):
    """Which meshes are wanted. Without frames: the clip at its working rate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: str
    frames: tuple[int, ...] = ()  # source numbers
    spacing_m: float = 0.01  # of the lattice that the surface is found on


def export_meshes(
    run: RunRecord, trained: Path, request: MeshRequest, out: Path, progress: Progress
) -> SurfaceMesh:
    """Write one animated .glb, or a folder with ``canonical.ply`` and ``%06d.ply`` per frame.

    Vertices are world metres; those of a .glb are turned upright by its node. Gives the canonical
    mesh.

    Raises:
        InputError: an unknown format, a place that is taken, a frame outside the clip, a spacing
            that is too fine, a scene without a surface, a full disk.
    """
    _require_new(out, request.format)
    clip = RunClip.of(run)
    frames = tuple(sorted(set(request.frames))) or clip.working_frames()
    clip.require_inside(map(clip.time, frames))
    scene = TrainedScene.open(trained)
    with torch_threads(scene.threads), full_disk_is_bad_input(str(out)):
        mesh = surface_mesh(scene.space.canonical(scene.field), request.spacing_m)
        poses = _poses(scene, clip, mesh, frames, progress)
        if request.format == "glb":
            _write_animation(run.scene, clip, mesh, frames, poses, out)
        else:
            _write_plys(mesh, frames, poses, out)
    return mesh


def carried(posed: PosedScene, points: Points) -> NDArray[np.float32]:
    """Canonical points (V, 3) at a scene's only moment, world metres.

    A point that the motion does not know moves as the nearest one that it knows.
    """
    canonical = torch.from_numpy(points.astype(np.float32))
    with torch.no_grad():
        observed, known = posed.to_observed(canonical, torch.zeros(len(points), dtype=torch.int64))
    moved, sure = observed.numpy(), known.numpy()
    if sure.any() and not sure.all():
        _, nearest = cKDTree(points[sure]).query(points[~sure])
        moved[~sure] = points[~sure] + (moved - points)[sure][nearest]
    return moved


def _require_new(out: Path, wanted: str) -> None:
    if wanted not in FORMATS:
        raise InputError(f"--format must be one of {', '.join(FORMATS)}", repr(wanted), "Choose.")
    if (wanted == "glb") != (out.suffix.lower() == ".glb"):
        place = "a file that ends in .glb" if wanted == "glb" else "a folder"
        raise InputError(f"--out of --format {wanted} must be {place}", str(out), "Rename it.")
    if out.exists() and (out.is_file() or any(out.iterdir())):
        raise InputError("--out must be new or empty", f"{out}, which is there", "Choose another.")


def _poses(
    scene: TrainedScene,
    clip: RunClip,
    mesh: SurfaceMesh,
    frames: tuple[int, ...],
    progress: Progress,
) -> Iterator[NDArray[np.float32]]:
    """The vertices (V, 3) at each frame."""
    for done, frame in enumerate(frames):
        yield carried(scene.at(clip.time(frame)), mesh.vertices)
        progress((done + 1) / len(frames), f"frame {frame}")


def _write_animation(
    name: str,
    clip: RunClip,
    mesh: SurfaceMesh,
    frames: tuple[int, ...],
    poses: Iterator[NDArray[np.float32]],
    out: Path,
) -> None:
    """Seconds count from the first of the frames."""
    animated = AnimatedMesh(
        name=name,
        vertices=mesh.vertices,
        faces=mesh.faces,
        colours=mesh.colours,
        poses=np.stack(list(poses)),
        pose_names=tuple(f"frame {frame}" for frame in frames),
        times_s=(np.array(frames) - frames[0]) / clip.source_fps,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_glb(out, animated, clip.up)


def _write_plys(
    mesh: SurfaceMesh,
    frames: tuple[int, ...],
    poses: Iterator[NDArray[np.float32]],
    out: Path,
) -> None:
    out.mkdir(parents=True, exist_ok=True)
    _write_ply(out / "canonical.ply", mesh, mesh.vertices)
    for frame, vertices in zip(frames, poses, strict=True):
        _write_ply(out / f"{frame:06d}.ply", mesh, vertices)


def _write_ply(path: Path, mesh: SurfaceMesh, vertices: NDArray[np.floating]) -> None:
    coloured = trimesh.Trimesh(
        vertices, mesh.faces, vertex_colors=as_bytes(mesh.colours), process=False
    )
    with whole_file(path) as beside:
        beside.write_bytes(trimesh.exchange.ply.export_ply(coloured))
