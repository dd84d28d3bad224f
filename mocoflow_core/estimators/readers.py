"""The reader of each kind of estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mocoflow_core.estimators import (
    aist_motion,
    easymocap,
    gvhmr,
    mesh_folder,
    native,
    pare,
    phalp,
    romp,
    tram,
    vibe,
    wham,
)
from mocoflow_core.estimators.configuration import Kind
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.known import Known
from mocoflow_core.estimators.stored import Stored


@dataclass(frozen=True)
class Reader:
    """How one kind is told, read, and which settings it reads beside model and faces."""

    title: str
    recognises: Callable[[Stored], bool]
    read: Callable[[Stored, Known], BodyEstimate]
    fields: frozenset[str]


def _reads(*fields: str) -> frozenset[str]:
    return frozenset(fields)


READERS: dict[Kind, Reader] = {
    "native": Reader("meshes.npz", native.recognises, native.read, _reads()),
    "vibe": Reader(
        "VIBE",
        vibe.recognises,
        vibe.read,
        _reads("person", "shape", "crop_factor", "first_frame"),
    ),
    "pare": Reader(
        "PARE",
        pare.recognises,
        pare.read,
        _reads("person", "shape", "crop_factor", "first_frame"),
    ),
    "wham": Reader(
        "WHAM", wham.recognises, wham.read, _reads("person", "shape", "focal_px", "first_frame")
    ),
    "phalp": Reader(
        "PHALP, 4D-Humans",
        phalp.recognises,
        phalp.read,
        _reads("person", "shape", "focal_px", "first_frame"),
    ),
    "gvhmr": Reader(
        "GVHMR", gvhmr.recognises, gvhmr.read, _reads("shape", "focal_px", "first_frame")
    ),
    "tram": Reader(
        "TRAM", tram.recognises, tram.read, _reads("person", "shape", "focal_px", "first_frame")
    ),
    "romp": Reader("ROMP, BEV", romp.recognises, romp.read, _reads("person", "shape")),
    "aist_motion": Reader(
        "AIST++ motion", aist_motion.recognises, aist_motion.read, _reads("first_frame")
    ),
    "easymocap": Reader(
        "EasyMocap, ZJU-MoCap params",
        easymocap.recognises,
        easymocap.read,
        _reads("person", "shape", "pose_blend_shapes"),
    ),
    "mesh_folder": Reader(
        "folder of OBJ, PLY or GLB", mesh_folder.recognises, mesh_folder.read, _reads("coordinates")
    ),
}
