"""Complete configurations: functions that return one."""

from __future__ import annotations

from collections.abc import Callable

from mocoflow_core.body.location import LocationConfig
from mocoflow_core.body.repair import RepairConfig
from mocoflow_core.capture.extract import CaptureConfig
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.fields.body_lattices import BodyMotionConfig
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.scene_shape import MotionConfig
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.methods.presentation import PresentationConfig
from mocoflow_core.methods.truth_errors import TruthConfig
from mocoflow_core.metrics.score import EvaluationConfig
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.rendering.sampling import SamplingConfig
from mocoflow_core.training.pretrain_density import DensityConfig
from mocoflow_core.training.schedule import ScheduleConfig


class Configuration(ConfigurationPart):
    """Everything that can be set, by stage."""

    capture: CaptureConfig = CaptureConfig()
    location: LocationConfig = LocationConfig()
    repair: RepairConfig = RepairConfig()
    plan: PlanConfig = PlanConfig()
    density: DensityConfig = DensityConfig()
    motion: MotionConfig = MotionConfig()
    canonical: CanonicalConfig = CanonicalConfig()
    sampling: SamplingConfig = SamplingConfig()
    losses: LossConfig = LossConfig()
    schedule: ScheduleConfig = ScheduleConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    truth: TruthConfig = TruthConfig()
    presentation: PresentationConfig = PresentationConfig()


def fast() -> Configuration:
    """Two CPU cores, a minute: the default."""
    return Configuration()


def toy() -> Configuration:
    """A few steps on coarse grids, for tests."""
    return Configuration(
        density=DensityConfig(spacing_m=0.03),
        motion=MotionConfig(body=BodyMotionConfig(node_spacing_m=0.1, control_spacing_m=0.08)),
        canonical=CanonicalConfig(finest_m=0.04, levels=2),
        sampling=SamplingConfig(step_m=0.03),
        schedule=ScheduleConfig(coarse_steps=10, fine_steps=10, rays=64, threads=1),
        presentation=PresentationConfig(turntable_views=4),
    )


PRESETS: dict[str, Callable[[], Configuration]] = {"fast": fast, "toy": toy}
