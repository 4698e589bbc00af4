"""Columns that are no recording: an exception says which and why."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import rigident

RIG = EXAMPLES / "bracket.rig.toml"
Columns = dict[str, Any]


def refused(columns: Any, rig: Any = RIG) -> rigident.RigidentError:
    with pytest.raises(rigident.RigidentError) as caught:
        rigident.identify(columns, rig=rig, name="run")
    assert caught.value.status == 2
    return caught.value


def test_numbers_that_are_not_finite_have_column_and_index(bracket: Columns) -> None:
    for value in (np.nan, np.inf, -np.inf):
        column = bracket["imu_gy_radps"].copy()
        column[17] = value
        error = refused({**bracket, "imu_gy_radps": column})
        assert error.place == rigident.Place(file="run", column="imu_gy_radps", index=17)
        assert "imu_gy_radps[17]" in str(error) and "not a finite number" in str(error)


def test_shapes(bracket: Columns) -> None:
    error = refused({**bracket, "fx_n": np.zeros((1001, 3))})
    assert error.place == rigident.Place(file="run", column="fx_n") and "(1001, 3)" in str(error)
    error = refused({**bracket, "mz_nm": bracket["mz_nm"][:-1]})
    assert "mz_nm has 1000 rows" in str(error)
    assert "()" in str(refused({**bracket, "fz_n": 1.0}))
    error = refused({name: column[:0] for name, column in bracket.items()})
    assert "no rows" in str(error)
    assert "no names of columns" in str(refused(np.zeros((10, 13))))


@pytest.mark.parametrize(
    ("column", "word"),
    [
        (np.zeros(1001, dtype=bool), "bool"),
        (np.zeros(1001, dtype=complex), "complex128"),
        (np.array(["1.0"] * 1001), "<U3"),
        (np.array([None] * 1001), "object"),
        (np.zeros(1001, dtype="datetime64[ns]"), "datetime64"),
        (np.full(1001, 2**64 - 1, dtype=np.uint64), "int64"),
    ],
)
def test_dtypes(bracket: Columns, column: Any, word: str) -> None:
    error = refused({**bracket, "fy_n": column})
    assert error.place is not None and error.place.column == "fy_n"
    assert word in str(error)


def test_masked_values_are_no_numbers(bracket: Columns) -> None:
    mask = np.arange(1001) == 17
    error = refused({**bracket, "fz_n": np.ma.masked_array(bracket["fz_n"], mask)})
    assert error.place == rigident.Place(file="run", column="fz_n", index=17) and "masked" in str(error)
    whole = np.ma.masked_array(bracket["fz_n"], np.zeros(1001, dtype=bool))
    assert rigident.identify({**bracket, "fz_n": whole}, rig=RIG).mass_kg is not None


def test_names_are_texts(bracket: Columns) -> None:
    assert "3 is no name of a column" in str(refused({**bracket, 3: bracket["fx_n"]}))
    with pytest.raises(rigident.RigidentError, match="needs a name"):
        rigident.identify(bracket, rig=RIG, name="")


def test_lists_that_are_no_numbers(bracket: Columns) -> None:
    error = refused({**bracket, "fy_n": [[1.0], [1.0, 2.0]]})
    assert error.place is not None and error.place.column == "fy_n"


def test_units_and_missing_columns(bracket: Columns) -> None:
    columns = dict(bracket)
    columns["fx_lbf"] = columns.pop("fx_n")
    assert "it must be fx_n" in str(refused(columns))
    columns = dict(bracket)
    del columns["my_nm"]
    assert "column my_nm is missing" in str(refused(columns))
    columns = dict(bracket)
    del columns["t_s"]
    assert "t_s is missing" in str(refused(columns))
    assert "none of its columns is known" in str(refused({"a": [1.0, 2.0]}))


def test_times_that_do_not_increase(bracket: Columns) -> None:
    time_s = bracket["t_s"].copy()
    time_s[500] = time_s[499]
    error = refused({**bracket, "t_s": time_s})
    assert error.place == rigident.Place(file="run", column="t_s", index=500)


def test_a_rig_as_mappings(bracket: Columns) -> None:
    rig = {"recording": {"rate_hz": 100.0}, "imu": [{"position_m": [0.05, -0.02, 0.03]}]}
    assert rigident.identify(bracket, rig=rig).status == "identified"
    error = refused(bracket, {"recording": {"rate": 100.0}})
    # Mappings have no lines.
    assert "rate_hz" in str(error) and error.place == rigident.Place(file="the rig")
    error = refused(bracket, "nowhere.rig.toml")
    assert error.place == rigident.Place(file="nowhere.rig.toml")


def test_whole_numbers_and_singles(bracket: Columns, tmp_path: Path) -> None:
    # Stamps in nanoseconds, as a data logger has them, keep every digit.
    stamps = np.round(bracket["t_s"] * 1e9).astype(np.int64) + 1_700_000_000_000_000_000
    columns = {name: column for name, column in bracket.items() if name != "t_s"}
    rig = {
        "recording": {"columns": {"t_s": {"name": "stamp", "scale": 1e-9}}},
        "imu": [{"position_m": [0.05, -0.02, 0.03]}],
    }
    by_stamps = rigident.identify({"stamp": stamps, **columns}, rig=rig)
    path = tmp_path / "run.csv"
    rows = zip(stamps.tolist(), *(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(["stamp", *columns]), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert np.array_equal(by_stamps.values(), rigident.identify(path, rig=rig).values())
    single = {name: column.astype(np.float32) for name, column in columns.items()}
    assert rigident.identify({"stamp": stamps, **single}, rig=rig).status == "identified"


def test_an_exception_goes_from_a_worker_to_its_owner(bracket: Columns) -> None:
    error = refused({**bracket, "fx_n": np.zeros((2, 2))})
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.status, again.place) == (str(error), error.status, error.place)


def test_things_that_are_no_recording() -> None:
    with pytest.raises(TypeError, match="int is no recording"):
        rigident.identify(7)  # type: ignore[arg-type]


def test_values_that_a_rig_cannot_hold_are_reported_with_their_key(bracket: Columns) -> None:
    for value, word in [(np.nan, "nan is not a finite number"), (None, "NoneType"), (1j, "complex")]:
        error = refused(bracket, rig={"load_cell": {"noise_n_nm": [0.1, value, 0.1, 0.1, 0.1, 0.1]}})
        assert "load_cell.noise_n_nm[1]" in str(error) and word in str(error)
    rig = {"recording": {"rate_hz": np.float64(100.0)}, "load_cell": {"noise_n_nm": np.full(6, 0.1)}}
    lists = {"recording": {"rate_hz": 100.0}, "load_cell": {"noise_n_nm": [0.1] * 6}}
    found = [rigident.identify(bracket, rig=one).object["parameters"] for one in (rig, lists)]
    assert found[0] == found[1]
