"""The licences of everything that is installed with mocoflow: ``python -m docs.licences``.

Writes ``docs/licences.md`` from what the installed packages say of themselves.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/licences.md"
UNKNOWN = "unknown"

# Licences that ask something of whoever passes the package on in a changed or linked form.
COPYLEFT = re.compile(r"GPL|General Public|MPL|Mozilla|EUPL|CDDL|EPL|Artistic", re.IGNORECASE)

# What a package's metadata leave out, read in the licence file that comes with it.
READ_IN_ITS_FILE = {
    "anny": "Apache-2.0; assets CC0-1.0",
    "embreex": "BSD-2-Clause; Embree Apache-2.0",
    "partd": "BSD-3-Clause",
}

# Why a copyleft licence is no hindrance, or what must be heeded.
REMARKS = {
    "av": "The package is BSD, but its wheels bring FFmpeg with x264 and x265, which are GPL-2.0: "
    "whoever passes on an image with them passes on GPL software, sources included. Nothing of "
    "mocoflow is linked with them beyond Python's import.",
    "certifi": "A list of certificates, used unchanged; MPL-2.0 asks for the source of changed "
    "files alone.",
    "hypothesis": "Used unchanged by tests; MPL-2.0 asks for the source of changed files alone.",
    "opencv-contrib-python-headless": "Its wheels bring FFmpeg under LGPL-2.1, as a library that "
    "can be replaced.",
    "orjson": "Used unchanged by Prefect; MPL-2.0 asks for the source of changed files alone.",
    "pathspec": "Used unchanged by mypy; MPL-2.0 asks for the source of changed files alone.",
    "torch": "Builds for CUDA bring NVIDIA's libraries under NVIDIA's own terms; those for the CPU "
    "do not.",
    "text-unidecode": "Either licence may be chosen; used under the Artistic License, unchanged, "
    "by Prefect's python-slugify.",
}


class Licensed(NamedTuple):
    """One package as the page shows it."""

    name: str
    version: str
    licence: str
    needed_for: str
    remark: str


def pinned() -> dict[str, str]:
    """Versions by name, of all packages in ``constraints.txt``."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return dict(line.split("==") for line in lines if "==" in line)


def licensed() -> list[Licensed]:
    """Every pinned package that is installed, with its licence and what needs it."""
    purposes = _purposes()
    found = []
    for name in pinned():
        package = _installed(name)
        if package is None:
            continue
        purpose = purposes.get(canonicalize_name(name), "development")
        remark = REMARKS.get(canonicalize_name(name), "")
        # A local part, as in 2.13.0+cpu, tells builds of one version apart.
        version = package.version.partition("+")[0]
        found.append(Licensed(name, version, licence_of(package), purpose, remark))
    return found


def licence_of(package: Distribution) -> str:
    """As the package states it: an SPDX expression, else its classifiers, else its field."""
    said = package.metadata
    name = canonicalize_name(said["Name"])
    if name in READ_IN_ITS_FILE:
        return READ_IN_ITS_FILE[name]
    expression = said.get("License-Expression")
    if expression:
        return str(expression)
    classifiers = said.get_all("Classifier") or []
    stated = [line.split("::")[-1].strip() for line in classifiers if line.startswith("License ::")]
    stated = [line for line in stated if line != "OSI Approved"]
    field = (said.get("License") or "").strip()
    return " or ".join(stated) or (field.splitlines()[0] if field else UNKNOWN)


def page() -> str:
    """The page's text."""
    rows = licensed()
    lines = [
        "# Licences of what is installed with mocoflow",
        "",
        "mocoflow itself is under Apache-2.0; the weights that come with it are named in its",
        "[notice](../mocoflow_core/perception/weights/NOTICE.md). These are the packages of",
        "`constraints.txt`, as they describe themselves; `python -m docs.licences` writes this.",
        "Weights, body models and data sets of others are not among them: see",
        "[datasets](datasets/README.md).",
        "",
        "| package | version | licence | needed for |",
        "|-|-|-|-|",
    ]
    lines += [f"| {r.name} | {r.version} | {r.licence} | {r.needed_for} |" for r in rows]
    lines += ["", "## Remarks", ""]
    lines += [f"- **{row.name}**: {row.remark}" for row in rows if row.remark]
    return "\n".join(lines) + "\n"


def _purposes() -> dict[str, str]:
    """What first needs a package: to run at all, or an extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = {"running": project["dependencies"], **project["optional-dependencies"]}
    purposes: dict[str, str] = {}
    for purpose in ("running", *sorted(asked.keys() - {"running", "dev"})):
        for name in _closure(asked[purpose]):
            purposes.setdefault(name, purpose)
    return purposes


def _closure(requirements: Iterable[str]) -> set[str]:
    """Names of packages with all that they require here, extras included."""
    seen: set[tuple[str, str]] = set()
    waiting = [Requirement(text) for text in requirements]
    while waiting:
        wanted = waiting.pop()
        for extra in ("", *wanted.extras):
            if (canonicalize_name(wanted.name), extra) not in seen:
                seen.add((canonicalize_name(wanted.name), extra))
                waiting += _requirements(wanted.name, extra)
    return {name for name, _ in seen}


def _requirements(name: str, extra: str) -> Iterator[Requirement]:
    package = _installed(name)
    for text in (package.requires or ()) if package else ():
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            yield requirement


def _installed(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
