"""Types: the package against itself, the stubs against what is compiled, and what a user writes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

USE = """
import numpy as np
from numpy.typing import NDArray
import rigident

result: rigident.Result = rigident.identify({"t_s": np.zeros(2)}, rig={"recording": {"rate_hz": 100.0}})
mass: float | None = result.mass_kg
com: NDArray[np.float64] | None = result.com_m
factor: rigident.Factor = rigident.Factor.merge(rigident.Factor.of("a.csv"), rigident.Factor.from_bytes(b""))
rows: NDArray[np.float64] = rigident.Model("human34").regressor([0.0], [0.0], [0.0])
plan: rigident.plan.Plan = rigident.plan.poses(5)
"""
WRONG = """
import rigident

rigident.identify("a.csv", no_such_option=1)
count: int = rigident.identify("a.csv").status
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder apart from the sources, so that what is installed is checked; numpy's types are read once."""
    return tmp_path_factory.mktemp("types")


def mypy(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "MYPY_CACHE_DIR": str(folder / "cache")}
    words = (sys.executable, "-m", *words)
    return subprocess.run(
        words, capture_output=True, text=True, timeout=600, check=False, cwd=folder, env=environment
    )


def test_the_package_is_well_typed(folder: Path) -> None:
    ended = mypy("mypy", "--strict", "-p", "rigident", folder=folder)
    assert ended.returncode == 0, ended.stdout


def test_the_stubs_are_those_of_the_compiled_part(folder: Path) -> None:
    ended = mypy("mypy.stubtest", "rigident", "--ignore-disjoint-bases", folder=folder)
    assert ended.returncode == 0, ended.stdout + ended.stderr


def test_the_code_of_a_user_is_checked(folder: Path) -> None:
    (folder / "use.py").write_text(USE, encoding="utf-8")
    ended = mypy("mypy", "--strict", "use.py", folder=folder)
    assert ended.returncode == 0, ended.stdout
    (folder / "wrong.py").write_text(WRONG, encoding="utf-8")
    ended = mypy("mypy", "--strict", "wrong.py", folder=folder)
    assert "Found 2 errors" in ended.stdout, ended.stdout
