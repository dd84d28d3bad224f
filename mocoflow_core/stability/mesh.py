"""Meshes as exporters break them: flat, doubled, inside out, with gaps, in other units."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.mesh_checks import UNIT_SIZES_M
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.signed_distance import signed_distance_lattice
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.stability.case import Case, Found, largest, require
from mocoflow_core.stability.figures import torso_and_arm
from mocoflow_core.stability.toy_scene import SCHEDULE, filmed, prepare, recorded, train

SPACING_M = 0.03
MARGIN_M = 0.1
UNITS = {1.0 / size: unit for unit, size in UNIT_SIZES_M.items()}


def _distance(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    return signed_distance_lattice(vertices, faces, SPACING_M, MARGIN_M)[1]


@cache
def _clean_distance() -> NDArray[np.float32]:
    return _distance(*torso_and_arm())


def _against_clean(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> Found:
    found, expected = _distance(vertices, faces), _clean_distance()
    return Found(largest(found - expected), (found,))


def _degenerate(share: float) -> Found:
    """Some faces twice more: with a corner named twice, and with a corner on top of another."""
    vertices, faces = torso_and_arm()
    chosen = faces[: int(share * len(faces))]
    twice = chosen[:, [0, 1, 1]]
    flat = np.stack([chosen[:, 0], chosen[:, 1], len(vertices) + chosen[:, 1]], -1)
    both = np.concatenate([faces, twice, flat]).astype(np.int32)
    return _against_clean(np.concatenate([vertices, vertices]), both)


def _doubled(share: float) -> Found:
    """Some faces get corners of their own: the surface is the same, its topology is not."""
    vertices, faces = torso_and_arm()
    own = int(share * len(faces))
    corners = vertices[faces[:own]].reshape(-1, 3)
    numbers = len(vertices) + np.arange(3 * own, dtype=np.int32).reshape(-1, 3)
    return _against_clean(
        np.concatenate([vertices, corners]), np.concatenate([numbers, faces[own:]])
    )


def _ingest(change: Callable[[MeshSequence], MeshSequence]) -> IngestedMeshes:
    """The toy scene's meshes, changed and read again by the project's own reader."""
    meshes = MeshSequence.load(recorded() / "meshes.npz")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "meshes.npz"
        change(meshes).save(file)
        return ingest_meshes(open_scene(recorded()), file)


def _refusal(change: Callable[[MeshSequence], MeshSequence]) -> str:
    try:
        _ingest(change)
    except InputError as error:
        return str(error)
    return ""


def _winding(share: float) -> Found:
    """All faces, or the last part of them, listed the other way round."""

    def turn(meshes: MeshSequence) -> MeshSequence:
        faces = meshes.faces.copy()
        first = round((1.0 - share) * len(faces))
        faces[first:] = faces[first:, ::-1]
        return replace(meshes, faces=faces)

    ingested = _ingest(turn)
    clean = MeshSequence.load(recorded() / "meshes.npz")
    found = _distance(ingested.meshes.vertices[0], ingested.meshes.faces)
    expected = _distance(clean.vertices[0], clean.faces)
    require(share < 0.5 or any("wind" in words for words in ingested.warnings), "not reported")
    return Found(largest(found - expected), (found,), "; ".join(ingested.warnings))


def _not_a_number(kind: str) -> Found:
    def plant(meshes: MeshSequence) -> MeshSequence:
        vertices = meshes.vertices.copy()
        vertices[3, 7, 1] = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}[kind]
        return replace(meshes, vertices=vertices)

    words = _refusal(plant)
    require("frame 3" in words and "vertex 7" in words, f"not refused where it is: {words!r}")
    return Found(0.0, remark=words)


def _wrong_unit(factor: float) -> Found:
    words = _refusal(lambda meshes: replace(meshes, vertices=np.float32(factor) * meshes.vertices))
    expected = next((unit for ratio, unit in UNITS.items() if abs(ratio / factor - 1) < 0.01), "")
    require(bool(words) == bool(expected), f"taken or refused wrongly: {words!r}")
    require(expected in words, f"another unit is named: {words}")
    return Found(0.0, remark=words)


def _gap(missing: float) -> Found:
    """Missing meshes inside the clip: short gaps are bridged, long ones refused."""
    count = int(missing)

    def cut(meshes: MeshSequence) -> MeshSequence:
        kept = np.delete(np.arange(len(meshes.frame_indices)), np.arange(6, 6 + count))
        return replace(
            meshes, frame_indices=meshes.frame_indices[kept], vertices=meshes.vertices[kept]
        )

    try:
        ingested = _ingest(cut)
    except InputError as error:
        require(count >= 3, f"a short gap is refused: {error}")
        return Found(0.0, remark=str(error))
    require(count < 3, "a long gap is bridged")
    clean = MeshSequence.load(recorded() / "meshes.npz")
    off = np.linalg.norm(ingested.meshes.vertices - clean.vertices, axis=-1)
    return Found(largest(off), (off,), "; ".join(ingested.warnings))


def _chord(missing: float) -> float:
    """How far a chord leaves its circle: the toy's arm reaches 0.75 m, turns 24, swings 10 degrees
    a frame."""
    step = np.radians(24.0 + 10.0) * (1.0 + missing)
    return float(0.75 * (1.0 - np.cos(step / 2))) + 1e-6


def _few_frames(frames: float) -> Found:
    """A clip so short that nothing moves in it goes through all stages."""
    clip, meshes, _ = filmed()
    rows = slice(0, int(frames))
    short = _frames_of(clip, rows)
    few = replace(meshes, frame_indices=meshes.frame_indices[rows], vertices=meshes.vertices[rows])
    schedule = SCHEDULE.model_copy(update={"coarse_steps": 5, "fine_steps": 5})
    outcome = train(prepare(short, few), schedule)
    require(not outcome.events, f"events: {outcome.events}")
    return Found(0.0, (*outcome.weights, outcome.psnr), f"{outcome.psnr:.1f} dB")


def _frames_of(clip: Clip, rows: slice) -> Clip:
    return replace(
        clip,
        frame_indices=clip.frame_indices[rows],
        frames=clip.frames[rows],
        masks=clip.masks[rows],
        has_mask=clip.has_mask[rows],
        held_out=clip.held_out[rows],
    )


CASES = (
    Case(
        "degenerate_triangles",
        "faces without area have no normal, and a division by it",
        "share of faces",
        (0.01, 0.5, 1.0),
        "signed distance of the clean mesh",
        _degenerate,
        1e-6,
        "m",
        "they add nothing to the surface; float32 rounding of distances below 1 m",
    ),
    Case(
        "duplicate_vertices",
        "faces that share no corner: no neighbour, no connected surface",
        "share of faces",
        (0.1, 1.0),
        "signed distance of the clean mesh",
        _doubled,
        1e-6,
        "m",
        "the surface is the same; float32 rounding of distances below 1 m",
    ),
    Case(
        "inverted_winding",
        "an inside-out mesh has its inside outside: a body without density",
        "share of faces",
        (0.0, 1.0),
        "signed distance of the clean mesh",
        _winding,
        1e-6,
        "m",
        "the faces are turned over, with a warning; float32 rounding of distances below 1 m",
    ),
    Case(
        "not_a_number",
        "one coordinate that is no number reaches every loss",
        "planted",
        ("nan", "inf", "-inf"),
        "refused, with frame and vertex",
        _not_a_number,
        0.0,
        "",
        "a refusal has no error",
    ),
    Case(
        "wrong_unit",
        "lattices of a body a thousand times too large do not fit into any memory",
        "factor",
        (1e-3, 0.1, 0.7, 1.0, 1.3, 10.0, 1.0 / 0.0254, 100.0, 1000.0),
        "refused, with the likely unit; a small or tall person is taken",
        _wrong_unit,
        0.0,
        "",
        "a refusal has no error",
    ),
    Case(
        "gap_in_the_frames",
        "the shape between two moments is a guess",
        "missing meshes",
        (0.0, 1.0, 2.0, 3.0, 6.0),
        "the true meshes; gaps above 0.25 s are refused",
        _gap,
        _chord,
        "m",
        "a hand that turns and swings leaves the straight line by its chord's height at most",
    ),
    Case(
        "few_frames",
        "one frame has no duration, no neighbour and no motion",
        "frames",
        (1.0, 2.0, 3.0),
        "all stages, ten steps, finite weights",
        _few_frames,
        0.0,
        "",
        "only finiteness counts: nobody can be seen from all sides in one frame",
        quick=False,
    ),
)
