"""What a synthetic scene is made of."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from mocoflow_core.capture.names import FolderName
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.synthetic.body_shape import BodyShape

MotionName = Literal["turn", "walk_circle", "dance", "fast_spin", "still"]
MeshEstimate = Literal["exact", "other_topology", "joint_noise", "other_shape"]


class RecordingConfig(ConfigurationPart):
    """How a performance is recorded. The same values give the same bytes."""

    name: FolderName = Field("turn", description="Name of the scene.")
    frames: int = Field(48, ge=1, description="Number of frames, spread over the whole motion.")
    fps: float = Field(12.0, gt=0, description="Frames per second that scene.json states.")
    width: int = Field(128, ge=8, description="Pixels of every camera.")
    height: int = Field(128, ge=8, description="Pixels of every camera.")
    cameras: int = Field(8, ge=1, description="Cameras on the ring; cam00 in front is trained on.")
    distance_m: float = Field(3.0, gt=1, lt=4, description="From the ring to its axis; walls at 4.")
    supersampling: int = Field(3, ge=1, le=8, description="Rays per pixel along each axis.")
    shadows: Literal["none", "cast"] = Field(
        "none", description="Whether the lamp's soft shadow falls on floor, walls and person."
    )
    located: bool = Field(
        True,
        description="World coordinates, or the train camera's axes with the root at the origin.",
    )
    seed: int = Field(0, ge=0, description="Of textures, noise and wrinkles.")


class SyntheticConfig(RecordingConfig):
    """One scene with the Anny body."""

    motion: MotionName = Field("turn", description="What the person does.")
    clothing: Literal["tight", "loose"] = Field(
        "tight", description="Painted on the skin, or standing off it by 1 to 4 cm and swaying."
    )
    mesh_estimate: MeshEstimate = Field(
        "other_topology",
        description="The meshes given: the body itself; the same surface with 1229 vertices; that "
        "with wrong joint angles; that of another person in the same pose.",
    )
    joint_noise_deg: float = Field(
        6.0, ge=0, lt=90, description="Root mean square angle of every joint's smooth error."
    )
    place_noise_m: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="Root mean square distance of the body's smooth error of place.",
    )
    shape: BodyShape = Field(BodyShape(height=0.4), description="The person filmed.")
    other_shape: BodyShape = Field(
        BodyShape(gender=0.5, weight=0.75, height=0.3),
        description="The person that mesh_estimate other_shape believes in.",
    )
