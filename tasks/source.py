"""The user's files, named by their content: the same bytes elsewhere are the same source."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from mocoflow_core.capture.scene import Scene
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
    """The body meshes: a file of the user's, or else the scene's own, if it brings one."""
    file = given or scene.meshes()
    if file is None or not file.is_file():
        return None
    described = scene.training_description()["meshes"]
    return Source(path=file, digest=digest_document([described, digest_file(file)]))


def evaluation_source(scene: Scene) -> Source:
    """What the other cameras recorded, and the truth. Only metrics may depend on it."""
    return _source(scene, scene.evaluation_description(), scene.evaluation_files())


def folder_source(folder: Path, names: Iterable[str]) -> Source:
    """The named files of a folder."""
    return Source(path=folder, digest=digest_files({name: folder / name for name in names}))


def _source(scene: Scene, description: dict[str, object], files: list[Path]) -> Source:
    contents = {str(file.relative_to(scene.root)): digest_file(file) for file in files}
    digest = digest_document({"description": description, "files": contents})
    return Source(path=scene.root, digest=digest, train_camera=scene.train_camera)
