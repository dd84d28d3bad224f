"""The reader of each kind of estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mocoflow_core.body.model_folder import Gender
from mocoflow_core.body.smpl_file import Family
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
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile


@dataclass(frozen=True)
class Reader:
    """How one kind is told, read, and which settings it reads beside model and faces.

    ``model``: whose bodies it stores, where they need a model for pose or faces.
    """

    title: str
    recognises: Callable[[EstimateFile], bool]
    read: Callable[[EstimateFile, EstimateContext], BodyEstimate]
    fields: frozenset[str]
    model: tuple[Family, Gender] | None = None


def _reads(*fields: str) -> frozenset[str]:
    return frozenset(fields)


_SMPL: tuple[Family, Gender] = ("SMPL", "neutral")
_SMPL_MALE: tuple[Family, Gender] = ("SMPL", "male")
_SMPLX: tuple[Family, Gender] = ("SMPL-X", "neutral")

READERS: dict[Kind, Reader] = {
    "native": Reader("meshes.npz", native.recognises, native.read, _reads()),
    "vibe": Reader(
        "VIBE",
        vibe.recognises,
        vibe.read,
        _reads("person", "shape", "crop_factor", "first_frame"),
        _SMPL,
    ),
    "pare": Reader(
        "PARE",
        pare.recognises,
        pare.read,
        _reads("person", "shape", "crop_factor", "first_frame"),
        _SMPL,
    ),
    "wham": Reader(
        "WHAM",
        wham.recognises,
        wham.read,
        _reads("person", "shape", "focal_px", "first_frame"),
        _SMPL,
    ),
    "phalp": Reader(
        "PHALP, 4D-Humans",
        phalp.recognises,
        phalp.read,
        _reads("person", "shape", "focal_px", "first_frame"),
        _SMPL,
    ),
    "gvhmr": Reader(
        "GVHMR", gvhmr.recognises, gvhmr.read, _reads("shape", "focal_px", "first_frame"), _SMPLX
    ),
    "tram": Reader(
        "TRAM",
        tram.recognises,
        tram.read,
        _reads("person", "shape", "focal_px", "first_frame"),
        _SMPL,
    ),
    "romp": Reader("ROMP, BEV", romp.recognises, romp.read, _reads("person", "shape"), _SMPL),
    "aist_motion": Reader(
        "AIST++ motion", aist_motion.recognises, aist_motion.read, _reads("first_frame"), _SMPL_MALE
    ),
    "easymocap": Reader(
        "EasyMocap, ZJU-MoCap params",
        easymocap.recognises,
        easymocap.read,
        _reads("person", "shape", "pose_blend_shapes"),
        _SMPL,
    ),
    "mesh_folder": Reader(
        "folder of OBJ, PLY or GLB", mesh_folder.recognises, mesh_folder.read, _reads("coordinates")
    ),
}
