"""Which body model of the user's an estimate needs."""

from __future__ import annotations

from pathlib import Path

from mocoflow_core.body.model_folder import models_in
from mocoflow_core.body.smpl_file import missing_model
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.estimate_file import EstimateFile
from mocoflow_core.estimators.read import kind_of
from mocoflow_core.estimators.readers import READERS


def choose_model(meshes: Path | None, chosen: EstimateConfig, by_default: Path) -> Path | None:
    """The model file: the one that is given, else that of the estimate's family in a folder.

    The folder is the one given in the file's place, or ``by_default``, which need not exist.
    None where nothing needs a model, or the default folder has none: then the reader says so.

    Raises InputError where the given folder lacks the model, and for unknown estimates.
    """
    given = chosen.body_model
    folder = given or by_default
    if not folder.is_dir() or meshes is None:
        return given
    needed = READERS[kind_of(EstimateFile(meshes), chosen)].model
    if needed is None:
        return None
    family, gender = needed
    found = models_in(folder, family, gender)
    if not found and given is not None:
        raise missing_model(f"a folder without the {gender} one, {folder}", family)
    return found[0] if found else None
