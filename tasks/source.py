"""The user's files, named by their content: the same bytes elsewhere are the same source."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from mocoflow_core.capture.scene import Scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.estimate_file import estimate_files
from mocoflow_core.io.content_key import digest_document, digest_file, digest_files


class Source(BaseModel):
    """Where files lie now, and the digest of what they say.

    ``train_camera`` is the scene's, where it is one; the digest knows it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: Path
    digest: str
    train_camera: str | None = None


def clip_source(scene: Scene) -> Source:
    """What the train camera recorded, without the meshes."""
    files = [file for file in scene.source_files() if file != scene.meshes()]
    return _source(scene, {**scene.training_description(), "meshes": None}, files)


def meshes_source(scene: Scene, given: Path | None) -> Source | None:
    """The body meshes: a file or folder of the user's, or the scene's own, if it brings one."""
    path = given or scene.meshes()
    if path is None or not path.exists():
        return None
    described = scene.training_description()["meshes"]
    return Source(path=path, digest=digest_document([described, _digest(path)]))


def file_source(file: Path | None, what: str) -> Source | None:
    """A single file of the user's. Raises InputError where a path leads to none."""
    if file is None:
        return None
    if not file.is_file():
        raise InputError(f"{what} must be a file", f"{file}", "Check the path.")
    return Source(path=file, digest=digest_file(file))


def evaluation_source(scene: Scene) -> Source:
    """What the other cameras recorded, and the truth. Only metrics may depend on it."""
    return _source(scene, scene.evaluation_description(), scene.evaluation_files())


def folder_source(folder: Path, names: Iterable[str]) -> Source:
    """The named files of a folder."""
    return Source(path=folder, digest=digest_files({name: folder / name for name in names}))


def _digest(path: Path) -> str:
    """Of a file's bytes, or of the names and bytes of all that a folder's reader may open."""
    if path.is_file():
        return digest_file(path)
    return digest_files({str(file.relative_to(path)): file for file in estimate_files(path)})


def _source(scene: Scene, description: dict[str, object], files: list[Path]) -> Source:
    contents = {str(file.relative_to(scene.root)): digest_file(file) for file in files}
    digest = digest_document({"description": description, "files": contents})
    return Source(path=scene.root, digest=digest, train_camera=scene.train_camera)
