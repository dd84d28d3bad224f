"""Synthetic scenes by name: generated at first use, kept in the user's cache."""

from __future__ import annotations

from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from flows.user_folders import cache_folder
from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.synthetic.catalogue import SCENES, named_scene
from mocoflow_core.synthetic.configuration import SyntheticConfig
from tasks.terminal_bar import terminal_bar

# What is reconstructed where no scene is named.
DEMO_SCENE = "turn"


def demo_scene(name: str) -> Path:
    """The folder of a synthetic scene, named as in ``named_scene``.

    It appears complete or not at all. Raises InputError for an unknown name and a full disk.
    """
    configuration = named_scene(name)
    digest = digest_document(configuration.model_dump(mode="json"))
    folder = cache_folder() / "scenes" / f"{configuration.name}-{digest[:12]}"
    if not folder.is_dir():
        with full_disk_is_bad_input(f"The folder {folder.parent}"):
            _make(configuration, folder)
    return folder


def named_demo(path: Path) -> Path | None:
    """The folder of the synthetic scene that a path of one word names, if it names one."""
    is_name = len(path.parts) == 1 and path.name.partition(",")[0] in SCENES
    return demo_scene(path.name) if is_name else None


def _make(configuration: SyntheticConfig, folder: Path) -> None:
    # The body model's package takes seconds to import, which most runs do without.
    from mocoflow_core.synthetic.scene_writer import write_scene

    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(mkdtemp(prefix=f"{configuration.name}-", dir=folder.parent))
    try:
        with terminal_bar(f"synth {configuration.name}") as progress:
            write_scene(configuration, beside, progress)
        try:
            beside.rename(folder)
        except OSError:
            if not folder.is_dir():  # Unless another process has made the same meanwhile.
                raise
    finally:
        rmtree(beside, ignore_errors=True)  # Gone already where all went well.
