"""Names of AIST Dance Video DB recordings, and what is known to be wrong with some of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from mocoflow_core.errors import InputError

ALL_CAMERAS = "cAll"
# sBM basic, sFM advanced: the situations that AIST++ annotates.
ANNOTATED_SITUATIONS = ("sBM", "sFM")
OTHER_SITUATIONS = {
    "sGR": "a group of three dancers",
    "sMC": "filmed with a moving camera",
    "sSH": "a showcase",
    "sCY": "a cypher",
    "sBT": "a battle",
}
# c05 of the first is not synchronised; c07 of the second is 640 x 480. AIST++ blanks both.
BAD_VIEWS = ("gBR_sBM_c05_d04_mBR0_ch01", "gJB_sBM_c07_d07_mJB3_ch05")
# In no list of videos: 12670 = 1408 x 9 - 2.
NEVER_RELEASED = ("gMH_sBM_c08_d23_mMH1_ch05", "gMH_sBM_c09_d22_mMH2_ch01")
_CAMERA_TAG = re.compile(r"c(\d\d|All)")


@dataclass(frozen=True)
class AistName:
    """``gGG_sSS_cNN_dNN_mGGk_chNN``, as of a video or, with ``cAll``, of a sequence."""

    tags: tuple[str, ...]

    @property
    def text(self) -> str:
        return "_".join(self.tags)

    @property
    def camera(self) -> str:
        return self.tags[self._camera_place]

    @property
    def situation(self) -> str | None:
        return next((tag for tag in self.tags if tag.startswith("s")), None)

    @property
    def sequence(self) -> str:
        """The name that annotations have."""
        return self.video(ALL_CAMERAS)

    def video(self, camera: str) -> str:
        """The name of the recording by one camera, ``c01`` to ``c09``."""
        place = self._camera_place
        return "_".join((*self.tags[:place], camera, *self.tags[place + 1 :]))

    @property
    def _camera_place(self) -> int:
        # Showcases and the like have three tags only, as in sSH_c01_v0.
        return 1 if len(self.tags) == 3 else 2


def parse_name(text: str) -> AistName:
    """The name of a video or sequence, with or without folder and ending.

    Raises InputError for what is no such name.
    """
    stem = Path(text.strip()).name.split(".")[0]
    tags = tuple(stem.split("_"))
    if len(tags) < 3 or not _CAMERA_TAG.fullmatch(AistName(tags).camera):
        raise InputError(
            "the name of an AIST video or sequence, as gBR_sBM_cAll_d04_mBR0_ch01",
            f"{text!r:.80}",
            "Keep the original file names.",
        )
    return AistName(tags)


def require_annotated(name: AistName) -> None:
    """Raise InputError for recordings that AIST++ has no annotations of, and say why."""
    if name.situation in ANNOTATED_SITUATIONS:
        return
    what = OTHER_SITUATIONS.get(name.situation or "", "of another kind")
    raise InputError(
        "a basic (sBM) or advanced (sFM) dance: one dancer, cameras that stand still",
        f"{name.text}, {what}",
        "AIST++ has no cameras and no motions of it.",
    )


def read_ignore_list(file: Path) -> frozenset[str]:
    """Sequence names, one a line; blanks and endings such as ``.json`` are stripped."""
    lines = (line.strip() for line in file.read_text(encoding="utf-8-sig").splitlines())
    return frozenset(line.split(".")[0].strip() for line in lines if line)
