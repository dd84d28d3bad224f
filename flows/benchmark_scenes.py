"""The scenes of a benchmark as people write them: folders, synthetic ones, or whole data sets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from flows.allowed_folders import AllowedFolders
from flows.data_set_scenes import is_data_set, recordings
from flows.demo_scene import demo_scene
from mocoflow_core.capture.names import is_one_line
from mocoflow_core.errors import InputError
from mocoflow_core.synthetic.catalogue import named_scene


class AskedScene(NamedTuple):
    """One scene of a benchmark."""

    name: str  # what the benchmark calls it
    where: Path | str  # a folder, or a synthetic scene's name with its settings
    train_camera: str | None  # null: the scene's own
    import_settings: tuple[str, ...] = ()  # of a data set's recording

    @property
    def settings(self) -> tuple[str, ...]:
        """What each of its runs is told."""
        return (f"capture.train_camera={self.train_camera}",) if self.train_camera else ()

    def folder(self) -> Path:
        """Where it lies; a synthetic one is made when it is first asked for."""
        return self.where if isinstance(self.where, Path) else demo_scene(self.where)


def read_scenes(words: Iterable[str]) -> tuple[AskedScene, ...]:
    """Scenes such as ``data/someone``, ``turn_noise6,seed=1`` and ``data/someone@cam02``.

    A folder is called by its last part, a synthetic scene as it is written, both with the camera.
    A data set's name, such as ``aist``, stands for all recordings below its root, and
    ``aist:NAME`` for one.

    Raises InputError for a scene that is none of these, and for two of one name.
    """
    scenes: dict[str, AskedScene] = {}
    for scene in (scene for word in words for scene in _read(word)):
        if scene.name in scenes:
            raise InputError(
                "Scenes of a benchmark have different names", repr(scene.name), "Rename a folder."
            )
        scenes[scene.name] = scene
    return tuple(scenes.values())


def in_full(word: str) -> str:
    """The same scene in a word that means the same in every working directory."""
    where, camera = _parts(word)
    if not _is_folder(where):
        return word
    folder = AllowedFolders.of_environment().to_read(Path(where), "scenes").resolve()
    return f"{folder}@{camera}" if camera else str(folder)


def _parts(word: str) -> tuple[str, str]:
    """Where a scene is, and the camera that is to be learned from, if one is named."""
    where, at, camera = word.rpartition("@")
    return (word, "") if not at or Path(word).is_dir() else (where, camera)


def _read(word: str) -> Iterator[AskedScene]:
    where, camera = _parts(word)
    behind = f"@{camera}" if camera else ""
    if _is_folder(where):
        folder = AllowedFolders.of_environment().to_read(Path(where), "scenes")
        if not folder.is_dir():
            raise InputError(
                "A scene is a folder or a synthetic one's name", repr(where), "Check the path."
            )
        name = _one_line(folder.resolve().name)
        yield AskedScene(f"{name}{behind}", folder, camera or None)
    elif is_data_set(where):
        for name, folder, choices in recordings(where):
            yield AskedScene(f"{_one_line(name)}{behind}", folder, camera or None, choices)
    else:
        yield AskedScene(f"{named_scene(where).name}{behind}", where, camera or None)


def _one_line(name: str) -> str:
    if not is_one_line(name):
        raise InputError(
            "A scene's folder has a name of one line without control characters",
            repr(name),
            "Rename the folder.",
        )
    return name


def _is_folder(where: str) -> bool:
    return "/" in where or Path(where).is_dir()
