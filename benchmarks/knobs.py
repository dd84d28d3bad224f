"""What trades seconds for error, and the values that the work-precision study sweeps."""

from __future__ import annotations

from typing import NamedTuple

from mocoflow_core.presets import Configuration, fast
from mocoflow_core.settings import with_settings


class Setting(NamedTuple):
    """One point of a sweep: the defaults with some fields changed."""

    knob: str
    value: str  # as people read it
    changes: tuple[str, ...]  # field=value

    @property
    def configuration(self) -> Configuration:
        return with_settings(fast(), self.changes)

    @property
    def is_default(self) -> bool:
        """Whether nothing is changed at all, wherever the defaults stand by now."""
        return self.configuration == fast()


class Knob(NamedTuple):
    """Settings of one kind, cheap ones first, and those of them that are usually measured."""

    name: str
    settings: tuple[Setting, ...]
    usual: tuple[str, ...]  # values

    def chosen(self, whole: bool) -> list[Setting]:
        """What is measured, apart from the defaults."""
        return [s for s in self.settings if not s.is_default and (whole or s.value in self.usual)]


def _steps(count: int) -> Setting:
    """Coarse and fine steps in the default's proportion."""
    coarse = round(count * fast().schedule.coarse_share)
    changes = (f"schedule.coarse_steps={coarse}", f"schedule.fine_steps={count - coarse}")
    return Setting("steps", str(count), changes)


def _shell(margin_m: float) -> Setting:
    """Room around what the masks show; the narrowest shell leaves it around a bare body."""
    narrowest = margin_m + 0.01
    changes = (f"plan.shell_margin_m={margin_m}", f"plan.narrowest_shell_m={narrowest:g}")
    return Setting("shell margin", _mm(margin_m), changes)


def _rates(factor: float) -> Setting:
    """Rates of the canonical field: they cost nothing, but decide what a step buys."""
    schedule = fast().schedule
    names = ("rate_features", "rate_networks")
    changes = tuple(f"schedule.{name}={getattr(schedule, name) * factor:g}" for name in names)
    return Setting("rates", f"x {factor:g}", changes)


def _precision(name: str) -> Setting:
    return Setting("precision", name, (f"schedule.precision={name}",))


def _repair(share: float) -> Setting:
    """Rounds of bending the joints, of both kinds in proportion."""
    repair = fast().repair
    masks, both = (round(share * part.rounds) for part in (repair.by_masks, repair.by_both))
    changes = (f"repair.by_masks.rounds={masks}", f"repair.by_both.rounds={both}")
    return Setting("repair rounds", f"{masks} + {both}", changes)


def _field(knob: str, field: str, *values: float) -> tuple[Setting, ...]:
    return tuple(Setting(knob, f"{value:g}", (f"{field}={value:g}",)) for value in values)


def _length(knob: str, field: str, *values_m: float) -> tuple[Setting, ...]:
    return tuple(Setting(knob, _mm(value), (f"{field}={value:g}",)) for value in values_m)


def _mm(length_m: float) -> str:
    return f"{1000 * length_m:g} mm"


STEPS = "steps"
KNOBS = (
    Knob(STEPS, tuple(map(_steps, (94, 188, 375, 750, 1500, 3000))), ("188", "375", "1500")),
    Knob("rays", _field("rays", "schedule.rays", 192, 384, 768, 1536), ("192", "768")),
    Knob(
        "samples",
        _length("samples", "sampling.step_m", 0.02, 0.014, 0.01, 0.007, 0.005),
        ("14 mm", "7 mm"),
    ),
    Knob(
        "finest cell",
        _length("finest cell", "canonical.finest_m", 0.02, 0.014, 0.01, 0.007, 0.005),
        ("20 mm", "10 mm"),
    ),
    Knob("levels", _field("levels", "canonical.levels", 1, 2, 3, 4), ("2",)),
    Knob("features", _field("features", "canonical.channels", 2, 4, 8, 16), ("4",)),
    Knob("hidden width", _field("hidden width", "canonical.hidden", 16, 32, 64), ("16",)),
    Knob("shell margin", tuple(map(_shell, (0.005, 0.01, 0.02, 0.03, 0.05))), ("10 mm", "30 mm")),
    Knob(
        "inner depth",
        _length("inner depth", "sampling.inner_depth_m", 0.032, 0.04, 0.06),
        ("32 mm",),
    ),
    Knob(
        "precision",
        tuple(map(_precision, ("float32", "bfloat16"))),
        ("bfloat16",),
    ),
    Knob("rates", tuple(map(_rates, (0.5, 1.0, 2.0, 4.0))), ("x 2",)),
    Knob(
        "motion lattice",
        _length("motion lattice", "motion.body.node_spacing_m", 0.06, 0.04, 0.03),
        (),
    ),
    Knob("repair rounds", tuple(map(_repair, (0.5, 1.0, 2.0))), ()),
)
DEFAULT = Setting("default", "", ())
# Thirty seconds and one minute end early where the default schedule is done before.
BUDGETS_S = (5, 10, 20, 30, 60)


def budget(seconds: int) -> Setting:
    """The defaults under a budget of the training clock."""
    return Setting("budget", f"{seconds} s", (f"schedule.budget_s={seconds}",))


def together(settings: tuple[Setting, ...]) -> Setting:
    """Several knobs turned at once."""
    name = ", ".join(f"{setting.knob} {setting.value}" for setting in settings)
    return Setting("joint", name, tuple(change for s in settings for change in s.changes))
