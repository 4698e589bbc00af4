"""People and bodies on springs: the numbers of the command line, and what is kept beside them."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from conftest import EXAMPLES, ROOT
from test_same_numbers import by_command, numbers

import rigident

PERSON = ROOT.parent / "shared" / "data" / "human_btk_pig_60kg_functional"
"""A person of 60 kg, who walks and stands."""

needs_data = pytest.mark.skipif(not PERSON.is_dir(), reason="the recordings in ../shared/data are not here")


@pytest.fixture(scope="module")
def person() -> rigident.Person:
    return rigident.identify_person(
        PERSON / "FunctionalWalk.c3d", standing=PERSON / "FunctionalStatic.c3d", mass_kg=60.0, parts=2
    )


@needs_data
def test_a_person_has_the_commands_numbers(person: rigident.Person, tmp_path: Path) -> None:
    standing = PERSON / "FunctionalStatic.c3d"
    words = ("--static", standing, "--mass-kg", 60.0, "--parts", 2, "--json", "--out", tmp_path / "out")
    printed = by_command("body", "identify", PERSON / "FunctionalWalk.c3d", *words)
    assert numbers(person.result.json) == numbers(printed)
    whole = json.loads(printed)["person"]
    assert person.mass_kg == whole["mass_kg"]["value"] and person.mass_u95_kg == whole["mass_kg"]["u95"]
    assert len(person.segments) == len(whole["segments"]) == 15
    assert person["pelvis"].mass_kg == next(s for s in whole["segments"] if s["name"] == "pelvis")["mass_kg"]["value"]
    for name, factor in person.factors.items():
        assert factor.to_bytes() == (tmp_path / "out" / name).read_bytes()
    assert set(person.pages) <= {path.name for path in (tmp_path / "out").iterdir()}


@needs_data
def test_a_persons_covariance_is_that_of_the_intervals(person: rigident.Person) -> None:
    numbered = [p for p in person.result.parameters if p.u95 is not None]
    u95 = np.array([p.u95 for p in numbered])
    c = person.result.covariance([p.name for p in numbered])
    assert c.shape == (len(numbered), len(numbered)) and np.allclose(c, c.T, rtol=1e-9, atol=0)
    k = u95 / np.sqrt(np.diag(c))
    most = person.result.object.get("coverage_factor", 2.0)
    assert np.all(k > 1.9599) and np.all(k < most + 1e-9)


@needs_data
def test_what_a_person_cannot_be() -> None:
    trial = PERSON / "FunctionalWalk.c3d"
    with pytest.raises(rigident.RigidentError, match='table "child": must be one of female, male, unknown'):
        rigident.identify_person(trial, table="child")
    with pytest.raises(rigident.RigidentError, match="a tool needs trials without it"):
        rigident.identify_person(trial, tool="racket")
    with pytest.raises(rigident.RigidentError, match="must be a number, or 'strides'"):
        rigident.identify_person(trial, parts="steps")
    with pytest.raises(rigident.RigidentError, match="nowhere.c3d"):
        rigident.identify_person("nowhere.c3d")


def test_a_body_on_springs_has_the_commands_numbers(tmp_path: Path) -> None:
    rigident.command("vibration", "demo", "--body", "horizontal", "--out", tmp_path / "demo")
    recording = next(path for path in (tmp_path / "demo").iterdir() if path.suffix == ".csv")
    found = rigident.identify_vibration(recording)
    printed = by_command("vibration", "identify", recording, "--json", "--out", tmp_path / "out")

    def kept(text: str) -> object:
        whole = json.loads(text)
        for way in ("by_modes", "by_motion"):
            assert whole[way].pop("date") and whole[way].pop("elapsed_s") >= 0.0
        return whole

    assert kept(found.json) == kept(printed)
    assert found.exit_status == 0 and len(found.modes) == 6 and found.by_motion is not None
    assert found.by_modes is not None and found.by_modes.mass_kg == json.loads(printed)["by_modes"]["mass_kg"]
    for name, factor in found.factors.items():
        assert factor.to_bytes() == (tmp_path / "out" / name).read_bytes()
    again = pickle.loads(pickle.dumps(found))
    assert again.json == found.json and again.by_modes.mass_kg == found.by_modes.mass_kg
    with pytest.raises(rigident.RigidentError, match="keeps no covariance"):
        found.by_modes.covariance()


def test_covariance_and_residuals_of_a_body() -> None:
    result = rigident.identify(EXAMPLES / "bracket.csv", residuals=True)
    names = [p.name for p in result.parameters]
    c = result.covariance()
    assert c.shape == (16, 16)
    k = result.u95(names) / np.sqrt(np.diag(c))
    assert np.all(k > 1.9599) and np.all(k < 2.0)
    # The variance of the centre of mass by its own formula: d(mcz/m) = (dmcz - c dm)/m.
    assert result.com_m is not None and result.com_u95_m is not None and result.mass_kg is not None
    w = np.array([-result.com_m[2], 1.0]) / result.mass_kg
    sd = float(np.sqrt(w @ result.covariance(["m", "mcz"]) @ w))
    assert abs(1.959964 * sd / result.com_u95_m[2] - 1.0) < 1e-3
    assert result.residuals is not None and result.residuals.channels == ("fx", "fy", "fz", "mx", "my", "mz")
    rms = np.sqrt(np.nanmean(result.residuals.values**2, axis=0))
    assert np.allclose(rms, result.object["residual_rms"], rtol=0.02)
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.covariance(), c) and again.residuals.units[3] == "N m"
    assert rigident.identify(EXAMPLES / "bracket.csv").residuals is None
    with pytest.raises(KeyError):
        result.covariance(["mass"])


def test_what_is_known_must_be_a_mapping() -> None:
    with pytest.raises(TypeError, match="is no mapping of names to pairs"):
        rigident.identify(EXAMPLES / "bracket.csv", known="mass_kg=3.2")  # type: ignore[arg-type]
