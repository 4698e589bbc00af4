"""Factors: merged, kept, refused."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import rigident

RIG = EXAMPLES / "bracket.rig.toml"


def halves(bracket: dict[str, Any]) -> list[rigident.Factor]:
    """Two recordings of one body."""
    spans = {"first": slice(0, 500), "second": slice(500, None)}
    return [
        rigident.Factor.of({k: v[span] for k, v in bracket.items()}, rig=RIG, name=name) for name, span in spans.items()
    ]


def test_merging_is_of_rows_and_idempotent(bracket: dict[str, Any]) -> None:
    first, second = halves(bracket)
    both = rigident.Factor.merge(first, second)
    assert both.rows == first.rows + second.rows
    assert set(both.recordings) == {"first", "second"}
    again = rigident.Factor.merge(both, first)
    assert again.rows == both.rows
    assert any("left out" in words for words in again.warnings)
    result = both.solve(rig=RIG)
    mass = result["m"]
    assert mass.value is not None and mass.u95 is not None
    assert abs(mass.value - 3.2) < 2 * mass.u95


def test_a_fixture_is_taken_off(bracket: dict[str, Any]) -> None:
    fixture, whole = halves(bracket)
    # The same body less itself: nothing is left but the noise of both.
    left = rigident.identify({k: v[500:] for k, v in bracket.items()}, rig=RIG, tare=fixture)
    mass = left["m"]
    assert mass.value is None or (mass.u95 is not None and abs(mass.value) < 2 * mass.u95)
    assert whole.solve()["m"].value is not None


def test_the_triangle_is_that_of_the_rows(bracket: dict[str, Any]) -> None:
    factor = rigident.Factor.of(bracket, rig=RIG)
    n = len(factor.parameters)
    assert factor.r.shape == (n, n) and factor.z.shape == (n,) and len(factor.units) == n
    assert np.array_equal(factor.r, np.triu(factor.r))
    estimate = np.linalg.solve(factor.r, factor.z)
    solved = factor.solve()
    value = solved["m"].value
    assert value is not None
    assert estimate[factor.parameters.index("m")] == pytest.approx(value, rel=1e-6)


def test_damaged_bytes_are_refused(bracket: dict[str, Any], tmp_path: Path) -> None:
    data = rigident.Factor.of(bracket, rig=RIG).to_bytes()
    for cut in (0, 10, len(data) // 2, len(data) - 1):
        with pytest.raises(rigident.RigidentError, match=r"half\.factor"):
            path = tmp_path / "half.factor"
            path.write_bytes(data[:cut])
            rigident.Factor.read(path)
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 0x40
    with pytest.raises(rigident.RigidentError):
        rigident.Factor.from_bytes(bytes(flipped))


def test_factors_of_other_models_are_refused(bracket: dict[str, Any]) -> None:
    links = rigident.Factor.of(EXAMPLES / "two-links.csv")
    with pytest.raises(rigident.RigidentError) as caught:
        rigident.Factor.merge(rigident.Factor.of(bracket, rig=RIG), links)
    assert caught.value.status == 2


def test_merged_factors_are_named_by_their_recordings(bracket: dict[str, Any]) -> None:
    one = rigident.Factor.of(bracket, rig=RIG, name="monday")
    other = rigident.Factor.of(EXAMPLES / "two-links.csv")
    with pytest.raises(rigident.RigidentError) as caught:
        rigident.Factor.merge(one, other)
    said = str(caught.value)
    assert "factor 2 (two-links) is of another model than factor 1 (monday)" in said and ".factor" not in said
    with pytest.raises(rigident.RigidentError, match="no factor to merge"):
        rigident.Factor.merge()
    for wrong in (b"RIGIDFAC", None):
        with pytest.raises(TypeError, match="is no factor"):
            rigident.Factor.merge(one, wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="str is no factor"):
        rigident.Factor.from_bytes("RIGIDFAC")  # type: ignore[arg-type]


def test_workers_send_factors(bracket: dict[str, Any]) -> None:
    factor = rigident.Factor.of(bracket, rig=RIG)
    assert factor.rows > 0
    again = pickle.loads(pickle.dumps(factor))
    assert again == factor and again.rows == factor.rows


def test_nothing_is_overwritten(bracket: dict[str, Any], tmp_path: Path) -> None:
    factor = rigident.Factor.of(bracket, rig=RIG)
    factor.write(tmp_path / "a.factor")
    with pytest.raises(FileExistsError):
        factor.write(tmp_path / "a.factor")
    assert rigident.Factor.read(tmp_path / "a.factor") == factor
