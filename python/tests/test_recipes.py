"""Recipes for collections: ten thousand recordings, two workers, one of which is killed."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import dask.bag
import numpy as np
import pytest
from distributed import Client, LocalCluster

import rigident

sys.path.insert(0, str(Path(__file__).parents[1] / "recipes"))
from with_dask import bodies  # noqa: E402

COUNT = 10_000
PARTS = 100
FEW = 300
MASSES = {"bracket": 3.2, "pump": 7.9}


def body(number: int) -> str:
    """The body of a recording."""
    return "pump" if number % 3 == 0 else "bracket"


def recording(number: int) -> dict[str, Any]:
    """A dozen still poses of a body on a load cell."""
    random = np.random.default_rng(number)
    up = random.normal(size=(12, 3))
    gravity = -9.80665 * up / np.linalg.norm(up, axis=1)[:, None]
    mass = MASSES[body(number)]
    force = -mass * gravity + random.normal(0, 0.1, (12, 3))
    moment = np.cross(mass * np.array([0.0, 0.01, 0.05]), -gravity) + random.normal(0, 0.005, (12, 3))
    numbers = np.column_stack([force, moment, gravity])
    names = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm", "gx_mps2", "gy_mps2", "gz_mps2"]
    return {name: numbers[:, k].copy() for k, name in enumerate(names)}


def reduced(number: int, folder: Path) -> rigident.Factor:
    """The factor of a recording, which is left in the folder, too."""
    rig = {
        "recording": {"static": True, "labels": {"body": body(number)}},
        "load_cell": {"noise_n_nm": [0.1, 0.1, 0.1, 0.005, 0.005, 0.005], "class": "exact"},
    }
    factor = rigident.Factor.of(recording(number), rig=rig, name=f"run {number}")
    path = folder / f"{number}.factor"
    if not path.exists():
        # A worker that is killed here leaves no half of it.
        half = folder / f"{number}.{os.getpid()}.half"
        half.write_bytes(factor.data)
        half.rename(path)
    with open(folder / f"{os.getpid()}.done", "a", encoding="utf-8") as done:
        done.write(f"{number}\n")
    return factor


def done(folder: Path) -> int:
    """How many recordings were reduced, those that were reduced twice counted twice."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in folder.glob("*.done"))


def information(factor: rigident.Factor) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The information of the rows, which no order of merging changes."""
    return factor.r.T @ factor.r


def test_ten_thousand_recordings_by_two_workers_one_of_which_is_killed(tmp_path: Path) -> None:
    factors, started = tmp_path / "factors", time.monotonic()
    factors.mkdir()
    numbers = dask.bag.from_sequence(range(COUNT), npartitions=PARTS)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        # What stands in a file of tests is sent by its content.
        import cloudpickle

        cloudpickle.register_pickle_by_value(sys.modules[__name__])
        cloudpickle.register_pickle_by_value(sys.modules["with_dask"])
        workers = client.run(os.getpid)
        pairs = client.compute(bodies(numbers, body, lambda number: reduced(number, factors)))
        while done(factors) < COUNT // 2:
            assert pairs.status != "error", pairs.exception()
            time.sleep(0.1)
        os.kill(next(iter(workers.values())), signal.SIGKILL)
        merged = dict(pairs.result())
    elapsed = time.monotonic() - started
    again = done(factors) - COUNT
    assert again > 0, "the killed worker had done something"
    found = {name for factor in merged.values() for name in factor.recordings}
    assert found == {f"run {number}" for number in range(COUNT)}
    assert sum(len(factor.recordings) for factor in merged.values()) == COUNT

    listed = tmp_path / "list.txt"
    listed.write_text("\n".join(str(path) for path in sorted(factors.glob("*.factor"))), encoding="utf-8")
    started = time.monotonic()
    rigident.command("merge", "--from", listed, "--by", "body", "--output", tmp_path / "bodies")
    serial_s = time.monotonic() - started
    for name, mass in MASSES.items():
        serial = rigident.Factor.read(tmp_path / "bodies" / f"body={name}.factor")
        assert serial.rows == merged[name].rows
        a, b = information(serial), information(merged[name])
        assert np.max(np.abs(a - b)) < 1e-12 * np.max(np.abs(a))
        value = merged[name].solve()["m"]
        assert value.value is not None and value.u95 is not None
        assert value.value == pytest.approx(mass, abs=1.5 * value.u95)
    started, alone = time.monotonic(), tmp_path / "alone"
    alone.mkdir()
    for number in range(FEW):
        reduced(number, alone)
    one_s = (time.monotonic() - started) / FEW
    print(
        f"{COUNT} recordings, {again} of them twice: {elapsed:.1f} s by two workers, "
        f"{1e3 * elapsed / COUNT:.1f} ms a recording, {1e3 * one_s:.1f} ms of one core alone; merging alone, by one process: {serial_s:.1f} s"
    )
