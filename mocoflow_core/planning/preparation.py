"""What the preparation of a scene needs: decided before anything of it is prepared."""

from __future__ import annotations

from mocoflow_core.capture.scene_description import BehindPerson
from mocoflow_core.errors import InputError
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision
from mocoflow_core.planning.inspection import Inspection


def decide_preparation(inspection: Inspection, configuration: PlanConfig) -> tuple[Decision, ...]:
    """The decisions that a look at the files allows.

    Raises InputError when something is forced off that the files do not bring.
    """
    return (
        decide_background(inspection, configuration),
        decide_segmentation(inspection, configuration),
        decide_location(inspection, configuration),
    )


def decide_background(inspection: Inspection, configuration: PlanConfig) -> Decision:
    """Whether what is behind the person must be found out from the frames."""
    given, force = inspection.background_given, configuration.background_extraction
    if not given and force == "off":
        raise InputError(
            "a background plate when plan.background_extraction is off",
            "a scene without one",
            "Add cameras.<name>.background, or leave the setting on auto.",
        )
    return Decision(
        name="background_extraction",
        part="preparation",
        needed=not given,
        reason="the scene brings a background plate" if given else "the scene brings no plate",
        evidence={"plates": float(given)},
        threshold=1.0,
        saves="the median over the frames in which the person does not cover a pixel",
    ).forced(force)


def decide_segmentation(inspection: Inspection, configuration: PlanConfig) -> Decision:
    """Whether the person must be told from the background in every frame."""
    given, force = inspection.masks_given, configuration.mask_segmentation
    if not given and force == "off":
        raise InputError(
            "masks when plan.mask_segmentation is off",
            "a scene without any",
            "Add cameras.<name>.masks, or leave the setting on auto.",
        )
    return Decision(
        name="mask_segmentation",
        part="preparation",
        needed=not given,
        reason="the scene brings masks" if given else "masks are the difference to the background",
        evidence={"masks": float(given)},
        threshold=1.0,
        saves="segmenting every frame",
    ).forced(force)


def decide_frames(repeated: int, kept: int, configuration: PlanConfig) -> Decision:
    """Whether frames that show nothing new are worked on; the extraction has counted them."""
    if configuration.repeated_frames == "on":
        reason = "not looked at"
    elif repeated:
        reason = f"{repeated} of {kept + repeated} frames repeat another one"
    else:
        reason = "no frame repeats another one"
    return Decision(
        name="repeated_frames",
        part="preparation",
        needed=False,
        reason=reason,
        evidence={"repeated": float(repeated), "kept": float(kept)},
        threshold=1.0,
        saves="up to 0.3 s for each frame in location, repair and motion",
    ).forced(configuration.repeated_frames)


def decide_shadows(
    shadowed: float, behind_person: BehindPerson, configuration: PlanConfig
) -> Decision:
    """Whether cast shadows are removed: ``capture.behind_person`` decides, the evidence advises.

    ``shadowed``: area in a shadow that the plate does not have, in sizes of the person.
    """
    reason = {
        "kept": "what is behind the person stays as the camera saw it",
        "plate": "the person is set before the background plate",
        "white": "the person is set before white",
    }[behind_person]
    if behind_person == "kept" and shadowed > configuration.faint_shadow:
        reason += ", moving shadows with it; capture.behind_person=plate removes them"
    return Decision(
        name="shadow_removal",
        part="preparation",
        needed=behind_person != "kept",
        reason=reason,
        evidence={"shadowed": shadowed},
        threshold=configuration.faint_shadow,
        saves="reading every frame a second time",
    )


def decide_location(inspection: Inspection, configuration: PlanConfig) -> Decision:
    """Whether the body's location must be searched; asked before any mesh is in the world.

    Raises InputError when it is forced off for meshes that have no location at all.
    """
    overlap = inspection.overlap
    if inspection.coordinates == "camera-root-centred" and configuration.location_search == "off":
        raise InputError(
            "meshes with a location when plan.location_search is off",
            "root-centred ones",
            "Leave plan.location_search on auto.",
        )
    if not inspection.located:
        reason = "the meshes come without a location that can be trusted"
        needed = True
    elif overlap is not None and overlap < configuration.trusted_overlap:
        reason = f"the given location overlaps the masks by {overlap:.2f} only"
        needed = True
    else:
        reason = "the meshes come with a location that overlaps the masks well"
        needed = False
    return Decision(
        name="location_search",
        part="preparation",
        needed=needed,
        reason=reason,
        evidence={} if overlap is None else {"overlap": overlap},
        threshold=configuration.trusted_overlap,
        saves="the 3-D grid search, about 0.1 s a frame",
    ).forced(configuration.location_search)
