"""Each import contract catches a violation that is planted in a copy of the tree."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLANTED = {
    "upstairs": ("tasks/stage.py", "import flows.reconstruct"),
    "no-prefect": ("mocoflow_core/presets.py", "import prefect"),
    "no-maths": ("flows/reconstruct.py", "import numpy"),
    "core": ("mocoflow_core/geometry/camera.py", "import mocoflow_core.capture.clip"),
    "metrics": ("mocoflow_core/metrics/psnr.py", "import mocoflow_core.training"),
    "io": ("mocoflow_core/io/store.py", "import mocoflow_core.body.mesh_sequence"),
    "synthetic": ("mocoflow_core/synthetic/__init__.py", "import mocoflow_core.rendering"),
}


def lint(tree: Path, contract: str):
    script = Path(sys.executable).parent / "lint-imports"
    return subprocess.run(
        [script, "--no-cache", "--contract", contract],
        cwd=tree,
        env={"PYTHONPATH": str(tree), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    copy = tmp_path_factory.mktemp("tree")
    for package in ("flows", "tasks", "mocoflow_core"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("*.pyc"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    return copy


@pytest.mark.parametrize("contract", PLANTED)
def test_a_planted_import_breaks_its_contract_and_no_other_import_does(tree, contract):
    assert lint(tree, contract).returncode == 0
    file, statement = PLANTED[contract]
    planted = tree / file
    original = planted.read_text()
    planted.write_text(f"{original}\n{statement}\n")
    broken = lint(tree, contract)
    planted.write_text(original)
    assert broken.returncode == 1
    assert "BROKEN" in broken.stdout
