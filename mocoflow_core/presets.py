"""Complete configurations: functions that return one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.repair import RepairConfig
from mocoflow_core.capture.extract import CaptureConfig
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.fields.body_lattices import BodyMotionConfig
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.network_field import NetworksConfig
from mocoflow_core.fields.scene_shape import MotionConfig
from mocoflow_core.fields.skip_network import SkipConfig
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.methods.presentation import PresentationConfig
from mocoflow_core.methods.truth_errors import TruthConfig
from mocoflow_core.metrics.person_judge import PersonScoreConfig
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.plan import Representation
from mocoflow_core.rendering.frame_box import BoxConfig
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.training.mesh_views import MeshViewsConfig
from mocoflow_core.training.pretrain_density import DensityConfig
from mocoflow_core.training.schedule import ScheduleConfig
from mocoflow_core.video.configuration import VideoConfig


class Configuration(ConfigurationPart):
    """Everything that can be set, by stage."""

    representation: Representation = "hybrid"
    video: VideoConfig = VideoConfig()
    capture: CaptureConfig = CaptureConfig()
    meshes: EstimateConfig = EstimateConfig()
    location: LocationConfig = LocationConfig()
    repair: RepairConfig = RepairConfig()
    plan: PlanConfig = PlanConfig()
    density: DensityConfig = DensityConfig()
    motion: MotionConfig = MotionConfig()
    canonical: CanonicalConfig = CanonicalConfig()
    sampling: SamplingConfig = SamplingConfig()
    networks: NetworksConfig = NetworksConfig()
    box: BoxConfig = BoxConfig()
    mesh_views: MeshViewsConfig = MeshViewsConfig()
    losses: LossConfig = LossConfig()
    schedule: ScheduleConfig = ScheduleConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    person_scores: PersonScoreConfig = PersonScoreConfig()
    truth: TruthConfig = TruthConfig()
    presentation: PresentationConfig = PresentationConfig()

    @property
    def location_search(self) -> LocationConfig:
        """How the location is searched; a search asked for by hand takes what it finds."""
        asked_for = self.plan.location_search == "on"
        return self.location.where_asked_for() if asked_for else self.location


def fast() -> Configuration:
    """Two CPU cores, a minute: the default."""
    return Configuration()


def toy() -> Configuration:
    """A few steps on coarse grids, for tests."""
    coarse = BodyMotionConfig(node_spacing_m=0.1, control_spacing_m=0.08)
    return Configuration(
        density=DensityConfig(spacing_m=0.03),
        motion=MotionConfig(body=coarse),
        canonical=CanonicalConfig(finest_m=0.04, levels=2),
        sampling=SamplingConfig(step_m=0.03),
        schedule=ScheduleConfig(coarse_steps=10, fine_steps=10, rays=64, threads=1),
        person_scores=PersonScoreConfig(use="off"),
        truth=TruthConfig(frames=4, spreading=coarse),
        presentation=PresentationConfig(turntable_views=4),
    )


def paper() -> Configuration:
    """The paper's networks, losses, sampling, stages and schedule (as for People-Snapshot).

    ``schedule.scale`` shrinks all counts of steps in proportion.
    """
    return Configuration(
        representation="networks",
        # What the paper always has, whatever a scene shows.
        plan=PlanConfig(
            body_repair="off",
            motion_fields="on",
            appearance_codes="on",
            initialisation="on",
            adaptive_box="on",
            canonical_frame="first",
        ),
        losses=LossConfig(silhouette_weight=0.0, consensus_points=None),
        schedule=ScheduleConfig(
            pretrain_steps=200_000,
            fit_steps=200_000,
            coarse_steps=1_500_000,
            fine_steps=1_000_000,
            rays=384,
            frames_per_step=1,
            rate_networks=5e-4,
            rate_motion=5e-4,
            adam_beta2=0.999,
            adam_epsilon=1e-8,
            averaging=0.0,
        ),
    )


def paper_aist() -> Configuration:
    """The paper's schedule for AIST."""
    return _with_steps(500_000, 1_500_000, 1_000_000)


def paper_zju_mocap() -> Configuration:
    """The paper's schedule for ZJU-MoCap."""
    return _with_steps(800_000, 2_000_000, 1_500_000)


def paper_small() -> Configuration:
    """The paper's method shrunk to minutes on two CPU cores: a reference, not a result."""
    size = SkipConfig(layers=4, width=64, skip=2)
    chosen = paper()
    return chosen.model_copy(
        update={
            "networks": NetworksConfig(radiance=size, motion=size, colour_width=32),
            "box": BoxConfig(coarse_samples=24, fine_samples=32),
            "mesh_views": MeshViewsConfig(views=40, side_px=100),
            "schedule": chosen.schedule.model_copy(
                update={
                    "pretrain_steps": 1000,
                    "fit_steps": 1000,
                    "coarse_steps": 1200,
                    "fine_steps": 800,
                    "rays": 256,
                    "rate_networks": 2e-3,
                    "rate_motion": 1e-3,
                }
            ),
        }
    )


def _with_steps(fit: int, coarse: int, fine: int) -> Configuration:
    """The paper's configuration with other (N1, N2, N3)."""
    chosen = paper()
    steps = {"fit_steps": fit, "coarse_steps": coarse, "fine_steps": fine}
    schedule = chosen.schedule.model_copy(update=steps)
    return chosen.model_copy(update={"schedule": schedule})


Preset = Literal["fast", "toy", "paper", "paper_aist", "paper_zju_mocap", "paper_small"]

PRESETS: dict[str, Callable[[], Configuration]] = {
    "fast": fast,
    "toy": toy,
    "paper": paper,
    "paper_aist": paper_aist,
    "paper_zju_mocap": paper_zju_mocap,
    "paper_small": paper_small,
}
