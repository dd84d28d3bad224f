"""From a data set on disk to a native scene folder, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.dataset_checks import check_dataset
from mocoflow_core.datasets.dataset_scene import DatasetScene
from mocoflow_core.datasets.kinds import DatasetKind
from mocoflow_core.datasets.write_dataset import require_new, write_dataset
from mocoflow_core.errors import InputError
from mocoflow_core.named_files import require_networks
from mocoflow_core.progress import Progress
from mocoflow_core.settings import with_settings

# Counts up when the same files give another scene folder.
ALGORITHM_VERSION = 3  # A video's frames that may be held out are not looked at.

# Whatever values of another type, size or nesting than the data set's lead to.
_OF_OTHER_CONTENT = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)


@dataclass(frozen=True)
class ImportedDataset:
    """What was assumed, measured and found unusual, in words and numbers.

    ``warnings`` are of the scene and its train camera, ``elsewhere`` of the evaluation cameras.
    """

    name: str
    train_camera: str
    remarks: tuple[str, ...]
    measured: dict[str, float]
    warnings: tuple[str, ...]
    elsewhere: tuple[str, ...]

    @property
    def of_train_camera(self) -> dict[str, float]:
        """What was measured of the scene as a whole and of the camera that is learned from."""
        return {
            name: value
            for name, value in self.measured.items()
            if " of " not in name or name.endswith(f" of {self.train_camera}")
        }


def configure(
    kind: DatasetKind, settings: Sequence[str], body_model: Path | None
) -> ConfigurationPart:
    """The kind's configuration with settings applied. Raises InputError for unknown ones."""
    chosen = with_settings(kind.configuration(), settings)
    if body_model is None:
        return chosen
    if "body_model" not in kind.configuration.model_fields:
        raise InputError(
            f"no body model for {kind.name}", str(body_model), "Leave --body-model out."
        )
    return chosen.model_copy(update={"body_model": body_model})


def import_dataset(
    kind: DatasetKind,
    source: Path,
    configuration: ConfigurationPart,
    out: Path,
    progress: Progress | None = None,
) -> ImportedDataset:
    """Read, check, and write as a scene folder, which appears whole or not at all.

    Raises InputError as the reader and the checks do, for a folder with content, and a full disk.
    """
    require_new(out)
    require_networks(configuration)
    scene = _read(kind, source, configuration, progress)
    findings = check_dataset(scene)
    imported = ImportedDataset(
        scene.name,
        scene.train_camera,
        (*scene.remarks, *scene.caveats),
        findings.measured,
        findings.warnings,
        findings.elsewhere,
    )
    record = {
        "kind": kind.name,
        "source": str(source.resolve()),
        "configuration": configuration.model_dump(mode="json"),
        "remarks": imported.remarks,
        "measured": imported.measured,
        "warnings": imported.warnings,
        "warnings_of_evaluation_cameras": imported.elsewhere,
    }
    write_dataset(scene, out, record, progress)
    return imported


def _read(
    kind: DatasetKind, source: Path, configuration: ConfigurationPart, progress: Progress | None
) -> DatasetScene:
    """What the kind's reader makes of a folder, whatever lies in its files; or of a file."""
    if kind.source == "file":
        return kind.open(source, configuration, progress)
    try:
        return kind.open(source, configuration, progress)
    except InputError:
        raise
    except _OF_OTHER_CONTENT as error:
        words = f"{type(error).__name__}: {next(iter(str(error).splitlines()), '')[:100]}"
        raise InputError(
            f"files of {kind.name} as they were distributed",
            f"others in {source} ({words})",
            "Copy them again from the data set.",
        ) from error
