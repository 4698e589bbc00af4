"""The numbers of the command line, to the last bit."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import rigident


def by_command(*words: object) -> str:
    """Runs the installed command in a process of its own."""
    program = Path(sys.executable).with_name("rigident")
    ended = subprocess.run(
        [program, *map(str, words)], capture_output=True, text=True, encoding="utf-8", timeout=120, check=False
    )
    assert ended.returncode in (0, 1), ended.stderr
    return ended.stdout


def numbers(text: str) -> list[str]:
    """Lines of an object of ``--json`` without the time of the run and how long it took.

    Parameters and jobs, options and commands there, are named in each way's own terms.
    """
    lines = text.strip().splitlines()
    kept = [line for line in lines if not line.lstrip().startswith(('"date":', '"elapsed_s":'))]
    assert len(lines) - len(kept) == 2, "date and elapsed_s are left out, nothing else"
    return [re.sub("`[^`]+`|--[a-z][a-z-]*", "``", line) for line in kept]


@pytest.mark.parametrize("name", ["bracket.csv", "two-links.csv"])
def test_identify_of_a_file(name: str, tmp_path: Path) -> None:
    path = EXAMPLES / name
    printed = by_command("identify", path, "--json", "--out", tmp_path / "out")
    result = rigident.identify(path)
    assert numbers(result.json) == numbers(printed)
    assert "`calibrate_rig()`" in result.json or "`rigident calibrate rig`" not in printed
    assert "`rigident " not in result.json


def test_identify_of_arrays_is_that_of_the_file(bracket: dict[str, Any]) -> None:
    rig = EXAMPLES / "bracket.rig.toml"
    of_file = rigident.identify(EXAMPLES / "bracket.csv")
    of_arrays = rigident.identify(bracket, rig=rig, name="bracket")
    assert numbers(of_arrays.json) == numbers(of_file.json)
    # A structured array is the same, whatever the order of its bytes in memory.
    fields = np.rec.fromarrays(list(bracket.values()), names=",".join(bracket))
    structured = rigident.identify(np.asarray(fields), rig=rig, name="bracket")
    assert numbers(structured.json) == numbers(of_file.json)
    assert of_arrays.factor is not None and of_file.factor is not None
    assert np.array_equal(of_arrays.factor.r, of_file.factor.r)


def test_numbers_are_those_of_the_object() -> None:
    result = rigident.identify(EXAMPLES / "bracket.csv")
    whole = result.object
    assert result.mass_kg == whole["mass_kg"]
    assert [p.value for p in result.parameters] == [p.get("value") for p in whole["parameters"]]
    assert result.com_m is not None and result.com_m.tolist() == whole["com_m"]
    tensor = result.inertia_com_kgm2
    assert tensor is not None and np.array_equal(tensor, tensor.T)
    xx, yy, zz, yz, zx, xy = whole["inertia_com_kgm2"]
    assert [tensor[0, 0], tensor[1, 1], tensor[2, 2]] == [xx, yy, zz]
    assert [tensor[1, 2], tensor[2, 0], tensor[0, 1]] == [yz, zx, xy]


def test_factors_and_their_answers(tmp_path: Path) -> None:
    path = EXAMPLES / "bracket.csv"
    written = tmp_path / "bracket.factor"
    by_command("factor", path, "-o", written)
    factor = rigident.Factor.of(path)
    assert factor.to_bytes() == written.read_bytes()
    printed = by_command("solve", written, "--json", "--known", "mass_kg=3.2±0.001")
    assert numbers(factor.solve(known={"mass_kg": (3.2, 0.001)}).json) == numbers(printed)


def test_options_have_the_meaning_of_the_command_line(tmp_path: Path) -> None:
    path = EXAMPLES / "bracket.csv"
    printed = by_command(
        "identify", path, "--json", "--out", tmp_path / "out", "--symmetry", "x±0.002", "--estimate", "m,mc", "--window", 8
    )
    result = rigident.identify(path, symmetry={"x": 0.002}, estimate=["m", "mc"], window_s=8)
    assert numbers(result.json) == numbers(printed)


def test_base_parameters() -> None:
    printed = by_command("model", "base-params", EXAMPLES / "two-links.rig.toml", "--floating", "--json")
    base = rigident.Model(EXAMPLES / "two-links.rig.toml").base_parameters(floating=True)
    assert base.object == json.loads(printed)


def test_plans(tmp_path: Path) -> None:
    out = tmp_path / "poses.json"
    printed = by_command("plan", "poses", "--n", 3, "--json", "--out", out)
    plan = rigident.plan.poses(3)
    assert plan.object == json.loads(printed)
    assert plan.text == out.read_text(encoding="utf-8")
