"""What a user asked for, resolved: scene, configuration, store."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from flows.allowed_addresses import require_allowed_address
from flows.allowed_folders import AllowedFolders
from flows.demo_scene import named_demo
from flows.imported_scene import scene_folder
from flows.stopping import read_target
from flows.user_folders import body_models_folder
from flows.users_store import open_users_store
from mocoflow_core.capture.extract import select_training_frames
from mocoflow_core.capture.scene import Scene, open_scene
from mocoflow_core.contradictions import require_sense
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.model_choice import choose_model
from mocoflow_core.io.content_key import key_of
from mocoflow_core.io.run_folder import RunFolder, RunRecord
from mocoflow_core.io.store import Store
from mocoflow_core.metrics.person_judge import require_own_networks
from mocoflow_core.presets import PRESETS, Configuration
from mocoflow_core.settings import with_settings
from mocoflow_core.training.devices import Devices, choose_devices
from tasks.source import Source, clip_source, evaluation_source, file_source, meshes_source

# Counts up when a finished folder of an earlier version must not be taken for a finished one.
REQUEST_VERSION = 1


class Request(BaseModel):
    """The parameters of a run; the flows and the command line share them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene_path: Path
    preset: str = "fast"
    meshes: Path | None = None
    seed: int = 0
    budget_s: float | None = None
    until: str | None = None
    settings: tuple[str, ...] = ()
    import_settings: tuple[str, ...] = ()
    store_url: str | None = None
    devices: int | None = None
    machines: int = 1
    rendezvous: str | None = None

    @cached_property
    def scene(self) -> Scene:
        chosen = self.configuration
        said = chosen.video if chosen.video != type(chosen.video)() else None
        folder = scene_folder(
            *(self._given_scene, self.meshes is not None, chosen.meshes.body_model, said),
            self.import_settings,
        )
        return open_scene(folder, chosen.capture.train_camera)

    @cached_property
    def _given_scene(self) -> Path:
        """A folder or a file that may be read, or the folder of a synthetic scene by name."""
        allowed = self._allowed.to_read(self.scene_path, "scene")
        return allowed if allowed.exists() else named_demo(self.scene_path) or allowed

    @property
    def _allowed(self) -> AllowedFolders:
        return AllowedFolders.of_environment()

    @cached_property
    def configuration(self) -> Configuration:
        """The preset with the settings, the budget and the score to reach applied.

        Raises InputError for settings that are unknown, contradict each other or are never read.
        """
        if self.preset not in PRESETS:
            raise InputError(
                f"--preset must be one of {', '.join(PRESETS)}", repr(self.preset), "Choose one."
            )
        budget = () if self.budget_s is None else (f"schedule.budget_s={self.budget_s}",)
        until = () if self.until is None else (read_target(self.until),)
        preset = PRESETS[self.preset]()
        chosen = with_settings(preset, (*self.settings, *budget, *until))
        self._allowed.check_files(chosen)
        require_sense(chosen, preset)
        return chosen

    @cached_property
    def processes(self) -> Devices:
        """What the optimisation runs on; its result is the same, but for rounding."""
        if self.rendezvous is not None:
            require_allowed_address(self.rendezvous, "rendezvous")
        return choose_devices(self.devices, self.machines, self.rendezvous)

    @cached_property
    def store(self) -> Store:
        return open_users_store(self.store_url)

    @cached_property
    def recording(self) -> Source:
        """The train camera's files."""
        return clip_source(self.scene)

    @cached_property
    def bodies(self) -> Source | None:
        """The body meshes' file or folder."""
        meshes = self._allowed.to_read(self.meshes, "meshes") if self.meshes else None
        if meshes and not meshes.exists():
            raise InputError("--meshes must be a file or a folder", str(meshes), "Check the path.")
        return meshes_source(self.scene, meshes)

    @cached_property
    def body_model(self) -> Source | None:
        """The body model's file: given, or in the given or the user's folder of them."""
        meshes = self.bodies.path if self.bodies else None
        file = choose_model(meshes, self.configuration.meshes, body_models_folder())
        return file_source(file, "--body-model")

    @cached_property
    def faces(self) -> Source | None:
        """The file whose faces the bodies share, where one is given."""
        return file_source(self.configuration.meshes.faces, "meshes.faces")

    @cached_property
    def others(self) -> Source:
        """The evaluation cameras' files and the truth."""
        return evaluation_source(self.scene)

    def check(self) -> None:
        """Raise InputError for what settings and file names show to be wrong, before any work."""
        select_training_frames(self.scene, self.configuration.capture)
        require_own_networks(self.configuration.person_scores)
        _ = self.bodies, self.body_model, self.faces, self.processes

    def claim(self, out: Path) -> RunFolder:
        """Take a folder for the results. Raises InputError when it holds anything else."""
        place = self._allowed.to_write(out, "out")
        self.check()
        begun = RunRecord(
            request=self._key(),
            scene=self.scene.description.name,
            scene_path=str(self.scene.root.resolve()),
            preset=self.preset,
            seed=self.seed,
            configuration=self.configuration.model_dump(mode="json"),
            store=self.store.url,
            license=self.scene.description.license,
            attribution=self.scene.description.attribution,
            remarks=tuple(self.scene.description.remarks),
        )
        return RunFolder.claim(place, begun)

    def _key(self) -> str:
        inputs = {
            "recording": self.recording.digest,
            "bodies": self.bodies.digest if self.bodies else "",
            "body_model": self.body_model.digest if self.body_model else "",
            "faces": self.faces.digest if self.faces else "",
            "others": self.others.digest,
        }
        # Files count by their content, wherever they lie.
        chosen = self.configuration
        chosen = chosen.model_copy(update={"meshes": chosen.meshes.without_files()})
        values = {"configuration": chosen.model_dump(mode="json"), "seed": self.seed}
        return key_of("reconstruct", REQUEST_VERSION, inputs, values)
