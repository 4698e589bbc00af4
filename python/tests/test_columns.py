"""Parquet by pyarrow and MAT by SciPy, which share no code with this project: the same numbers, and tables of factors."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from conftest import EXAMPLES

import rigident


def saved(name: str, columns: dict[str, Any], folder: Path) -> Path:
    """A recording of the columns with its rig file beside it."""
    path = folder / name
    shutil.copy(EXAMPLES / "bracket.rig.toml", path.with_suffix(".rig.toml"))
    match path.suffixes:
        case [".parquet"]:
            pq.write_table(pa.table(columns), path)
        case [".v2", ".parquet"]:
            pq.write_table(pa.table(columns), path, compression="none", use_dictionary=False, data_page_version="2.0")
        case [".mat"]:
            scipy.io.savemat(path, columns, do_compression=True)
        case _:
            by_column = {name: values.reshape(-1, 1) for name, values in columns.items()}
            scipy.io.savemat(path, {"run": by_column, "rate": 100.0, "note": "of a bracket"})
    return path


@pytest.mark.parametrize("name", ["a.parquet", "b.v2.parquet", "c.mat", "d.struct.mat"])
def test_a_table_is_the_recording_of_its_csv(name: str, bracket: dict[str, Any], tmp_path: Path) -> None:
    expected = rigident.identify(EXAMPLES / "bracket.csv").object["parameters"]
    path = saved(name, bracket, tmp_path)
    # NAME.rig.toml is beside NAME.parquet, whatever dots are in NAME.
    assert rigident.identify(path, rig=EXAMPLES / "bracket.rig.toml").object["parameters"] == expected


def test_other_packings_are_refused_by_name(bracket: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(bracket), path, compression="brotli")
    with pytest.raises(rigident.RigidentError, match="packed by brotli.*zstd, gzip, lz4 or snappy"):
        rigident.identify(path)


@pytest.mark.parametrize("packing", ["zstd", "gzip", "lz4", "snappy", "none"])
def test_common_packings_are_read(packing: str, bracket: dict[str, Any], tmp_path: Path) -> None:
    expected = rigident.identify(EXAMPLES / "bracket.csv").object["parameters"]
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(bracket), path, compression=packing)
    assert rigident.identify(path, rig=EXAMPLES / "bracket.rig.toml").object["parameters"] == expected


def test_a_cell_without_a_number_is_reported_with_its_place(bracket: dict[str, Any], tmp_path: Path) -> None:
    force = [None if k == 17 else value for k, value in enumerate(bracket["fz_n"])]
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({**bracket, "fz_n": force}), path)
    with pytest.raises(rigident.RigidentError) as caught:
        rigident.identify(path)
    assert caught.value.place is not None
    assert (caught.value.place.column, caught.value.place.index) == ("fz_n", 17)


def test_tables_of_factors_are_read_and_written_by_others(bracket: dict[str, Any], tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0, 0.01, len(bracket["fx_n"]))
    first = saved("a.parquet", bracket, tmp_path)
    second = saved("b.parquet", {**bracket, "fx_n": bracket["fx_n"] + noise}, tmp_path)
    runs = tmp_path / "runs.parquet"
    rigident.command("factor", first, second, "--label", "body=bracket", "--output", runs)
    table = pq.read_table(runs)
    assert table.column_names == ["name", "label_body", "runs", "rows", "parameters", "model", "factor"]
    assert table["label_body"].to_pylist() == ["bracket", "bracket"] and table["runs"].to_pylist() == [1, 1]
    factors = [rigident.Factor.from_bytes(data) for data in table["factor"].to_pylist()]
    assert [factor.rows for factor in factors] == table["rows"].to_pylist()
    # As another program wrote it: other columns, another order, many groups of rows.
    other = tmp_path / "other.parquet"
    pq.write_table(pa.table({"day": ["tuesday", "monday"], "factor": table["factor"].take([1, 0])}), other, row_group_size=1)
    rigident.command("merge", other, "--output", tmp_path / "merged.factor")
    merged, expected = rigident.Factor.read(tmp_path / "merged.factor"), rigident.Factor.merge(*factors[::-1])
    assert np.array_equal(merged.r, expected.r) and np.array_equal(merged.z, expected.z)
    assert sorted(merged.recordings) == ["a", "b"]
