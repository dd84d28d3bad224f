"""What looks like ZJU-MoCap and is not: each is refused with its own words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mocoflow_core.errors import InputError

CALIBRATION_KEYS = ("K", "D", "R", "T")
_ORIGINAL = "Give a folder of the original release: annots.npy, Camera_B1 ... or Camera (1) ..."


def lookalike_tree(folder: Path) -> str | None:
    """What a folder without annots.npy is, where it is a known relative of ZJU-MoCap."""
    if (folder / "annots_new.npy").is_file():
        return "the refined release (annots_new.npy holds cameras without a picture list)"
    if (folder / "mesh_infos.pkl").is_file():
        return "HumanNeRF's derived files (cameras.pkl, mesh_infos.pkl: one camera, metres)"
    if (folder / "intri.yml").is_file():
        return "EasyMocap's calibration files (intri.yml and extri.yml, in metres)"
    return None


def refuse_lookalike_tree(folder: Path) -> None:
    """Raise InputError when a folder without annots.npy is a known relative of ZJU-MoCap."""
    if what := lookalike_tree(folder):
        raise _is(what)


def refuse_lookalike_content(content: dict[str, Any], name: str) -> None:
    """Raise InputError when a dictionary is no ``cams`` with K, D, R, T and no list of ``ims``."""
    cams, frames = content.get("cams"), content.get("ims")
    if not isinstance(cams, dict):
        raise InputError(
            f"{name} must hold cams and ims", f"{', '.join(map(str, content)):.80}", _ORIGINAL
        )
    missing = [key for key in CALIBRATION_KEYS if key not in cams]
    if len(missing) == len(CALIBRATION_KEYS):
        raise _is(
            f"a camera dictionary in GeneBody's style (cams keyed {', '.join(map(str, cams)):.40}, "
            "camera to world)"
        )
    if missing:
        raise InputError(f"K, D, R and T in cams of {name}", f"no {', '.join(missing)}", _ORIGINAL)
    if frames is None or not len(frames):
        raise _is("a file like annots_new.npy of the refined release: cameras, but no pictures")
    first = frames[0].get("ims") if isinstance(frames[0], dict) else None
    if first is not None and len(first) and str(first[0]).replace("\\", "/").startswith("images/"):
        raise _is("the refined release (pictures under images/00)")


def _is(what: str) -> InputError:
    return InputError("ZJU-MoCap in its original layout", what, _ORIGINAL)
