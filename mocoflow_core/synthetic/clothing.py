"""The person's colours and, in loose clothes, how far the surface stands off the skin.

Everything is a function of the rest-pose position, so it sticks to the body at any resolution.
Details are 15 to 30 mm: two pixels of a 128 to 256 pixel high image.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.synthetic.person import LIMBS, Person
from mocoflow_core.synthetic.texture import (
    Array,
    Mask,
    Noise,
    checker,
    glyph,
    linear,
    rectangle_outline,
    stripes,
    within,
)

# Heights above the hip joints in the rest pose and shares of the arm's length, metres and 1.
_WAIST, _COLLAR, _HEM = 0.07, 0.515, 0.06
_CUFF, _BAND = 0.62, (0.86, 0.93)


@dataclass(frozen=True, eq=False)
class Outfit:
    """Shirt with a print, jeans, shoes, hair and a face for one person."""

    person: Person
    seed: int

    @cached_property
    def _noise(self) -> Noise:
        return Noise(self.seed)

    @cached_property
    def face_limbs(self) -> NDArray[np.int8]:
        """(F,) index into LIMBS of each outer face."""
        weights = self.person.limb_weights[self.person.outer_faces].sum(axis=1)
        return weights.argmax(axis=1).astype(np.int8)

    @cached_property
    def _eyes(self) -> NDArray[np.float64]:
        return self.person.bone_head("eye.L")

    @cached_property
    def _ankle_z(self) -> float:
        return float(self.person.bone_head("foot.L")[2])

    @cached_property
    def _sole_z(self) -> float:
        return float(self.person.rest_vertices[self.person.outer_faces, 2].min())

    def _along_arm(self, points: Array) -> Array:
        """0 at the shoulder, 1 at the wrist; the same for both arms."""
        shoulder, wrist = (self.person.bone_head(bone) for bone in ("upperarm01.L", "wrist.L"))
        axis = (wrist - shoulder) / np.sum((wrist - shoulder) ** 2)
        left = np.where([True, False, False], np.abs(points), points)
        return ((left - shoulder) @ axis).astype(np.float32)

    def albedo(self, points: Array, limbs: NDArray[np.int8]) -> Array:
        """Linear reflectance (N, 3) at rest-pose points (N, 3) of the given limbs (N,)."""
        colours = np.empty_like(points)
        painters = {
            "torso": self._torso,
            "head": self._head,
            "arm.L": self._left_arm,
            "arm.R": self._right_arm,
            "hand.L": self._skin,
            "hand.R": self._skin,
            "leg.L": self._leg,
            "leg.R": self._leg,
            "foot.L": self._shoe,
            "foot.R": self._shoe,
        }
        for index, limb in enumerate(LIMBS):
            chosen = np.flatnonzero(limbs == index)
            if len(chosen):
                colours[chosen] = painters[limb](points[chosen])
        fine = 0.22 * self._noise(points, 0.018) + 0.12 * self._noise(points + 0.31, 0.05)
        return colours * (1 + fine)[:, None]

    def _skin(self, points: Array) -> Array:
        blush = 0.5 + 0.5 * self._noise(points, 0.03)
        return linear("#c98f6c") * (1 - blush[:, None]) + linear("#e0ac88") * blush[:, None]

    def _torso(self, points: Array) -> Array:
        x, y, z = points.T
        colours = np.where(stripes(z, 0.06)[:, None], linear("#24407c"), linear("#e9e1cf"))
        back = y > 0.02
        chevron = back & stripes(z + 0.6 * np.abs(x), 0.08)
        _paint(colours, back, "#dd7a2c")
        _paint(colours, chevron, "#3b2352")
        self._paint_print(colours, x, z - 0.33, ~back)
        self._paint_number(colours, -x, z - 0.31, back)
        _paint(colours, within(y, 0.012, 0.028) & (z < 0.4), "#101820")
        _paint(colours, z > _COLLAR, "#a3202c")
        _paint(colours, within(z, _HEM, _HEM + 0.03), "#101820")
        lower = z < _HEM
        colours[lower] = self._leg(points[lower])
        _paint(colours, within(z, _HEM - 0.045, _HEM), "#5a3a1e")
        _paint(colours, within(z, _HEM - 0.045, _HEM) & (np.abs(x) < 0.028) & ~back, "#e8c84a")
        bare = z > _COLLAR + 0.035
        colours[bare] = self._skin(points[bare])
        return colours

    @staticmethod
    def _paint_print(colours: Array, u: Array, v: Array, side: Mask) -> None:
        panel = side & (np.abs(u) < 0.12) & (np.abs(v) < 0.12)
        _paint(colours, panel, "#f4d33c")
        _paint(colours, panel & checker(u, v, 0.03), "#1d7a5a")
        _paint(colours, side & glyph("4", u, v, 0.028), "#b3122e")
        _paint(colours, side & rectangle_outline(u, v, 0.135, 0.135, 0.016), "#ffffff")

    @staticmethod
    def _paint_number(colours: Array, u: Array, v: Array, side: Mask) -> None:
        _paint(colours, side & (np.abs(u) < 0.1) & (np.abs(v) < 0.13), "#f5f1e6")
        _paint(colours, side & glyph("7", u, v, 0.032), "#0c5f8a")

    def _arm(self, points: Array, dark: str, light: str) -> Array:
        along = self._along_arm(points)
        colours = np.where(stripes(along, 0.11)[:, None], linear(dark), linear(light))
        _paint(colours, within(points[:, 1], 0.015, 0.03), "#101820")
        _paint(colours, along > _CUFF - 0.03, "#f3efe2")
        bare = along > _CUFF
        colours[bare] = self._skin(points[bare])
        return colours

    def _left_arm(self, points: Array) -> Array:
        colours = self._arm(points, "#b3122e", "#f0e6d2")
        _paint(colours, within(self._along_arm(points), *_BAND), "#1a1a22")
        return colours

    def _right_arm(self, points: Array) -> Array:
        return self._arm(points, "#0f7a78", "#f0e6d2")

    def _leg(self, points: Array) -> Array:
        x, y, z = points.T
        side = np.abs(x)
        colours = np.where(stripes(z + x + y, 0.035)[:, None], linear("#35507e"), linear("#43619a"))
        colours *= (1 + 0.3 * self._noise(points, (0.03, 0.03, 0.09)))[:, None]
        seam = within(y, -0.008, 0.012) & (side > 0.1)
        _paint(colours, seam & stripes(z, 0.05), "#f0962e")
        _paint(colours, seam & ~stripes(z, 0.05), "#16233c")
        inner = within(y, 0.0, 0.014) & (side < 0.1)
        _paint(colours, inner, "#16233c")
        back = y > 0.05
        _paint(
            colours, back & rectangle_outline(side - 0.095, z + 0.07, 0.055, 0.06, 0.014), "#f0962e"
        )
        patch = (y < -0.02) & (np.abs(side - 0.16) < 0.05) & (np.abs(z + 0.42) < 0.06)
        _paint(colours, patch & (x > 0), "#7c1d2b")
        _paint(colours, patch & (x > 0) & checker(x, z, 0.025), "#e8d9b0")
        stripe = (y < 0) & within(side - 0.11 + 0.11 * z, -0.008, 0.012)
        _paint(colours, stripe & (x < 0), "#e9e9ee")
        _paint(colours, z < self._ankle_z + 0.11, "#9fb6d6")
        _paint(colours, within(z, self._ankle_z + 0.09, self._ankle_z + 0.11), "#16233c")
        _paint(colours, z < self._ankle_z + 0.04, "#e6e2da")
        return colours

    def _shoe(self, points: Array) -> Array:
        _, y, z = points.T
        colours = np.where(stripes(y, 0.06)[:, None], linear("#7a1420"), linear("#8f1d2a"))
        laces = (z > self._ankle_z - 0.06) & within(y, -0.12, -0.02)
        _paint(colours, laces & stripes(y, 0.03), "#f4f4f0")
        _paint(colours, y < -0.17, "#e8e4da")
        _paint(colours, z < self._sole_z + 0.03, "#f4f4f0")
        _paint(colours, z > self._ankle_z + 0.01, "#e6e2da")
        return colours

    def _head(self, points: Array) -> Array:
        x, eye_y, z = np.abs(points[:, 0]), self._eyes[1], points[:, 2] - np.float32(self._eyes[2])
        colours = self._skin(points)
        front = points[:, 1] < eye_y + 0.035
        eye = x - self._eyes[0]
        _paint(colours, front & _ellipse(eye, z, 0.019, 0.011), "#f4f0ea")
        _paint(colours, front & _ellipse(eye, z, 0.008, 0.01), "#2a3f2c")
        _paint(colours, front & (np.abs(x - 0.034) < 0.022) & within(z, 0.018, 0.029), "#2c1a10")
        _paint(colours, front & _ellipse(x, z + 0.068, 0.027, 0.009), "#a8323c")
        _paint(colours, front & _ellipse(x - 0.045, z + 0.035, 0.016, 0.012), "#dd8a74")
        fringe = 0.055 + 0.012 * np.sign(np.sin(points[:, 0] / 0.008))
        hair = (z > fringe) | ((points[:, 1] > eye_y + 0.085) & (z > -0.075))
        colours[hair] = self._hair(points[hair])
        return colours

    def _hair(self, points: Array) -> Array:
        strands = 0.5 + 0.5 * self._noise(points, (0.016, 0.03, 0.12))
        return linear("#1d120b") * (1 - strands[:, None]) + linear("#7a4a24") * strands[:, None]

    def _limb_weight(self, *limbs: str) -> NDArray[np.float64]:
        return self.person.limb_weights[:, [LIMBS.index(limb) for limb in limbs]].sum(axis=1)

    def stand_off(self, time: float) -> NDArray[np.float64]:
        """How far loose clothes stand off the skin at each vertex (V,), metres.

        They sway with the normalised time and vanish where limbs meet, lest they interpenetrate.
        """
        points = self.person.rest_vertices.astype(np.float32)
        z, along = points[:, 2], self._along_arm(points)
        shirt = np.where(within(z, _HEM, _COLLAR), 0.012 + 0.05 * (0.45 - z).clip(0, 0.36), 0)
        sleeve = np.where(within(along, 0.1, _CUFF), 0.01 + 0.03 * along, 0)
        jeans = np.where(z > self._ankle_z + 0.04, 0.012 + 0.03 * (-z).clip(0, 0.9), 0)
        hair = np.where(z > self._eyes[2] + 0.06, 0.018, 0)
        parts = [
            (("torso",), shirt),
            (("arm.L", "arm.R"), sleeve),
            (("leg.L", "leg.R"), jeans),
            (("head",), hair),
        ]
        clear = [(2 * self._limb_weight(*limbs) - 1).clip(0, 1) * part for limbs, part in parts]
        offset = np.sum(clear, axis=0)
        sway = np.sin(2 * np.pi * (6 * time + 3 * z + 2 * points[:, 0]))
        wrinkles = self._noise(points, 0.07)
        return offset * (1 + 0.25 * sway + 0.3 * wrinkles)


def _paint(colours: Array, mask: Mask, colour: str) -> None:
    colours[mask] = linear(colour)


def _ellipse(u: NDArray[np.floating], v: Array, half_u: float, half_v: float) -> Mask:
    return (u / half_u) ** 2 + (v / half_v) ** 2 < 1
