"""Looks at pictures of one person with detectors that no training has seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import cv2
import numpy as np
from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.lpips_weights import own_lpips_weights
from mocoflow_core.metrics.oks import centred_oks
from mocoflow_core.metrics.perceptual import LpipsAlex
from mocoflow_core.metrics.plausibility import person_box
from mocoflow_core.perception.movenet import MoveNetThunder
from mocoflow_core.perception.nanodet import NanoDet
from mocoflow_core.perception.network_file import FileOfNetwork, NetworkFile
from mocoflow_core.perception.own_networks import own_keypoint_detector, own_person_detector
from mocoflow_core.perception.person import (
    KeypointDetector,
    Keypoints,
    PersonDetector,
    Picture,
)


class PersonScoreConfig(ConfigurationPart):
    """The scores that networks give: lpips_alex, plausibility, oks."""

    use: Literal["auto", "on", "off"] = Field(
        "auto",
        description="on: refused where a network's weights are missing; auto: then those scores "
        "are absent, with the reason beside the others; off: none of them.",
    )
    detector: NetworkFile | None = Field(
        None,
        description="A Mask R-CNN or Keypoint R-CNN that finds persons: .onnx, or weights of "
        "torchvision; null: NanoDet.",
    )
    keypoints: NetworkFile | None = Field(
        None, description="A Keypoint R-CNN that finds their keypoints; null: MoveNet."
    )
    lpips: NetworkFile | None = Field(
        None,
        description="An AlexNet for LPIPS: .safetensors with heads, or torchvision's weights, to "
        "which the official heads are added; null: the one that comes with the package.",
    )
    views: int = Field(
        12, ge=1, description="Views that the detectors look at, drawn once by evaluation.seed."
    )
    confidence: float = Field(
        0.5, gt=0.0, le=1.0, description="A box counts as a person from this confidence on."
    )
    least_area: float = Field(
        0.02, ge=0.0, le=1.0, description="And from this share of the picture on."
    )
    surround: float = Field(
        1.6,
        ge=1.0,
        description="The detectors look at the crop in a white border, so many times as wide: "
        "a person who fills the picture is found less surely.",
    )
    keypoint_confidence: float = Field(
        0.3, gt=0.0, le=1.0, description="Points of the photograph that OKS compares."
    )
    on_curve: bool = Field(
        False,
        description="They are measured along the error curve as well: some seconds more for each "
        "of its points, which the training clock does not count.",
    )
    orbit_moments: int = Field(
        3, ge=1, description="Moments shown from all around where no other camera exists."
    )
    orbit_views: int = Field(8, ge=3, description="Directions of each of these moments.")

    @property
    def own_files(self) -> list[FileOfNetwork]:
        """The files of the user's own networks."""
        named = (self.detector, self.keypoints, self.lpips)
        return [file for file in named if file is not None]


class Sight(NamedTuple):
    """What the detectors saw in one picture."""

    person: bool
    pose: Keypoints | None  # None where there is no person


class PersonJudge:
    """A person detector and a keypoint detector that looks into the box of the first."""

    def __init__(
        self,
        configuration: PersonScoreConfig,
        detector: PersonDetector | None = None,
        keypoints: KeypointDetector | None = None,
    ) -> None:
        """Without detectors: those of the configuration."""
        self._configuration = configuration
        self._detector = detector or _person_detector(configuration)
        self._keypoints = keypoints or _keypoint_detector(configuration)

    def look(self, pictures: Sequence[Picture]) -> list[Sight]:
        """One sight of each picture (H, W, 3), its most confident person."""
        borders = [self._border(picture) for picture in pictures]
        framed = [_framed(picture, px) for picture, px in zip(pictures, borders, strict=True)]
        chosen = [
            person_box(
                boxes,
                float(picture.shape[0] * picture.shape[1]),
                self._configuration.confidence,
                self._configuration.least_area,
            )
            for picture, boxes in zip(framed, self._detector.boxes(framed), strict=True)
        ]
        found = [row for row, box in enumerate(chosen) if box is not None]
        poses = self._keypoints.keypoints(
            [framed[row] for row in found], [box for box in chosen if box is not None]
        )
        by_row = dict(zip(found, poses, strict=True))
        return [
            Sight(row in by_row, _without_border(by_row.get(row), px))
            for row, px in enumerate(borders)
        ]

    def look_shifted(self, pictures: Sequence[Picture]) -> list[Sight]:
        """Sights of the pictures shifted by half a pixel: nothing else about them is wrong."""
        return self.look([_half_a_pixel_off(picture) for picture in pictures])

    def _border(self, picture: Picture) -> int:
        return round(0.5 * (self._configuration.surround - 1.0) * max(picture.shape[:2]))

    def has_reference(self, sight: Sight) -> bool:
        """Whether a photograph's pose has points to compare with."""
        least = self._configuration.keypoint_confidence
        return sight.pose is not None and bool((sight.pose.confidence >= least).any())

    def similarity(self, sight: Sight, reference: Sight, area_px: float) -> float:
        """OKS about the means: 0 where the sight has no pose, NaN where the reference has none."""
        if reference.pose is None:
            return float("nan")
        if sight.pose is None:
            return 0.0
        least = self._configuration.keypoint_confidence
        return centred_oks(sight.pose, reference.pose, area_px, least)

    def plausibility_protocol(self) -> str:
        """What counts as a person, by which detector."""
        chosen, detector = self._configuration, self._detector
        return (
            f"person: {detector.name} {detector.digest[:12]}, confidence from "
            f"{chosen.confidence:g}, box from {chosen.least_area:g} of the picture, which is "
            f"{chosen.surround:g} crops wide, white around, scaled to the network"
        )

    def keypoints_name(self) -> str:
        """Which keypoints, and where they are looked for."""
        return (
            f"keypoints: {self._keypoints.name} {self._keypoints.digest[:12]} in the person's box"
        )

    def oks_protocol(self) -> str:
        """Which keypoints are compared, and how."""
        return (
            f"{self.keypoints_name()} of either picture; points from "
            f"{self._configuration.keypoint_confidence:g} in the photograph, "
            "each pose about their mean, COCO sigmas, area of the truth mask; 0 without a person "
            "in the render"
        )


def _framed(picture: Picture, border_px: int) -> Picture:
    sides = ((border_px, border_px), (border_px, border_px), (0, 0))
    return np.pad(picture, sides, constant_values=255)


def _without_border(pose: Keypoints | None, border_px: int) -> Keypoints | None:
    """A pose of the framed picture as one of the picture."""
    return pose and Keypoints(pose.places - np.float32(border_px), pose.confidence)


def _half_a_pixel_off(picture: Picture) -> Picture:
    move = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])
    size = (picture.shape[1], picture.shape[0])
    return np.asarray(cv2.warpAffine(picture, move, size, borderMode=cv2.BORDER_REPLICATE))


class Networks(NamedTuple):
    """What looks at the pictures."""

    judge: PersonJudge
    lpips: LpipsAlex


def open_networks(configuration: PersonScoreConfig) -> Networks | str:
    """The networks, or the reason why they are not there; no reason where nobody wants them.

    Raises:
        InputError: weights are missing and the configuration asks for them, or a file that it names
            is no such network.
    """
    if configuration.use == "off":
        return ""
    if configuration.own_files:
        return _networks(configuration)
    try:
        return _networks(configuration)
    except InputError as error:
        if configuration.use == "on":
            raise
        return str(error)


def require_own_networks(configuration: PersonScoreConfig) -> None:
    """Raise InputError where a file that the configuration names is no such network."""
    if configuration.use != "off" and configuration.own_files:
        _networks(configuration)


def _networks(configuration: PersonScoreConfig) -> Networks:
    own = configuration.lpips
    weights = None if own is None else own_lpips_weights(own)
    return Networks(PersonJudge(configuration), LpipsAlex(weights))


def _person_detector(configuration: PersonScoreConfig) -> PersonDetector:
    if configuration.detector is not None:
        return own_person_detector(configuration.detector)
    return NanoDet(least_confidence=min(0.2, configuration.confidence))


def _keypoint_detector(configuration: PersonScoreConfig) -> KeypointDetector:
    if configuration.keypoints is not None:
        return own_keypoint_detector(configuration.keypoints)
    return MoveNetThunder()
