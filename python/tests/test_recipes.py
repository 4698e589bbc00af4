"""Recipes for collections: thousands of recordings, two workers, one of which is killed; trees and people."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cloudpickle
import dask.bag
import numpy as np
import psutil
import pyspark
import pytest
from distributed import Client, LocalCluster

import rigident

sys.path.insert(0, str(Path(__file__).parents[1] / "recipes"))
import with_dask  # noqa: E402
import with_spark  # noqa: E402

# At night ten thousand, and by both engines.
COUNT = 10_000 if os.environ.get("RIGIDENT_NIGHTLY") else 1_000
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


def assert_same_information(serial: rigident.Factor, merged: rigident.Factor) -> None:
    """The order of merging changes no more than rounding."""
    a, b = information(serial), information(merged)
    assert np.max(np.abs(a - b)) < 1e-12 * np.max(np.abs(a))


class Dask:
    """Two workers of Dask."""

    def __init__(self) -> None:
        self.cluster = LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
        self.client = Client(self.cluster)
        # Definitions in a file of tests are sent by their content.
        for module in (sys.modules[__name__], with_dask):
            cloudpickle.register_pickle_by_value(module)

    def reduce(
        self, items: Sequence[Any], key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor], parts: int
    ) -> dict[Any, rigident.Factor]:
        """The factor of each key."""
        bag = dask.bag.from_sequence(items, npartitions=parts)
        return dict(self.client.compute(with_dask.bodies(bag, key, factor)).result())

    def kill_one(self) -> None:
        """Kills a worker."""
        os.kill(next(iter(self.client.run(os.getpid).values())), signal.SIGKILL)

    def close(self) -> None:
        """Ends them."""
        self.client.close()
        self.cluster.close()


class Spark:
    """Two executors of Spark, each a process of its own."""

    def __init__(self) -> None:
        settings = {
            "spark.master": "local-cluster[2,1,1024]",
            "spark.app.name": "recipes",
            "spark.executor.memory": "512m",
            "spark.driver.host": "127.0.0.1",
            "spark.driver.bindAddress": "127.0.0.1",
            "spark.ui.enabled": "false",
            "spark.ui.showConsoleProgress": "false",
        }
        os.environ.update({"PYSPARK_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1"})
        self.context = pyspark.SparkContext(conf=pyspark.SparkConf().setAll(list(settings.items())))
        self.context.setLogLevel("ERROR")
        for module in (sys.modules[__name__], with_spark):
            pyspark.cloudpickle.register_pickle_by_value(module)

    def reduce(
        self, items: Sequence[Any], key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor], parts: int
    ) -> dict[Any, rigident.Factor]:
        """The factor of each key."""
        return dict(with_spark.bodies(self.context.parallelize(items, parts), key, factor).collect())

    def kill_one(self) -> None:
        """Kills an executor."""
        running = psutil.Process().children(recursive=True)
        next(one for one in running if any("CoarseGrainedExecutorBackend" in word for word in one.cmdline())).kill()

    def close(self) -> None:
        """Ends them."""
        self.context.stop()


@pytest.fixture(scope="module", params=[Dask, pytest.param(Spark, marks=pytest.mark.nightly)])
def workers(request: pytest.FixtureRequest) -> Iterator[Dask | Spark]:
    """Two workers of an engine."""
    engine = request.param()
    yield engine
    engine.close()


def test_thousands_of_recordings_by_two_workers_one_of_which_is_killed(workers: Dask | Spark, tmp_path: Path) -> None:
    factors, started = tmp_path / "factors", time.monotonic()
    factors.mkdir()
    with ThreadPoolExecutor(1) as thread:
        pending = thread.submit(workers.reduce, range(COUNT), body, lambda number: reduced(number, factors), PARTS)
        while done(factors) < COUNT // 2:
            assert not pending.done(), pending.exception()
            time.sleep(0.1)
        workers.kill_one()
        merged = pending.result()
    elapsed = time.monotonic() - started
    again = done(factors) - COUNT
    assert again > 0, "the killed worker had done something"
    # A factor of this many has only their number; the serial merge below shows that each is in it once.
    assert sum(factor.runs for factor in merged.values()) == COUNT

    listed = tmp_path / "list.txt"
    listed.write_text("\n".join(str(path) for path in sorted(factors.glob("*.factor"))), encoding="utf-8")
    started = time.monotonic()
    rigident.command("merge", "--from", listed, "--by", "body", "--output", tmp_path / "bodies")
    serial_s = time.monotonic() - started
    for name, mass in MASSES.items():
        serial = rigident.Factor.read(tmp_path / "bodies" / f"body={name}.factor")
        assert serial.rows == merged[name].rows
        assert_same_information(serial, merged[name])
        value = merged[name].solve()["m"]
        assert value.value is not None and value.u95 is not None
        assert value.value == pytest.approx(mass, abs=1.5 * value.u95)
    started, alone = time.monotonic(), tmp_path / "alone"
    alone.mkdir()
    for number in range(FEW):
        reduced(number, alone)
    one_s = (time.monotonic() - started) / FEW
    print(
        f"{type(workers).__name__}: {COUNT} recordings, {again} of them twice: {elapsed:.1f} s by two workers, "
        f"{1e3 * elapsed / COUNT:.1f} ms a recording, {1e3 * one_s:.1f} ms of one core alone; merging alone, by one process: {serial_s:.1f} s"
    )


@pytest.fixture(scope="module")
def tree_runs(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, dict[str, Any]]]:
    """Runs of two links, and pieces of the motion of two people; each with its key and what `Factor.of` takes."""
    runs, folder = [], tmp_path_factory.mktemp("trees")
    for seed in range(1, 4):
        out = folder / f"links {seed}"
        rigident.command("demo", "--body", "two-links", "--duration-s", "20", "--seed", str(seed), "--out", out)
        runs.append(("two links", str(out), {}))
    for seed in range(1, 3):
        # The seed draws the person, too.
        out = folder / f"person {seed}"
        rigident.command("demo", "--body", "human34", "--duration-s", "10", "--seed", str(seed), "--out", out)
        lines = (out / "demo.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        first = next(k for k, line in enumerate(lines) if line.startswith("t_s"))
        for piece in range(3):
            rows = lines[first + 1 + 330 * piece :][:330]
            path = folder / f"person {seed} {piece}.csv"
            path.write_text("".join([lines[first], *rows]), encoding="utf-8")
            rig = str(out / "demo.rig.toml")
            runs.append((f"person {seed}", str(path), {"rig": rig, "model": "human34"}))
    return runs


def test_trees_and_people_are_reduced_as_bodies_are(
    workers: Dask | Spark, tree_runs: list[tuple[str, str, dict[str, Any]]]
) -> None:
    def reduced_tree(run: tuple[str, str, dict[str, Any]]) -> rigident.Factor:
        return rigident.Factor.of(run[1], **run[2])

    merged = workers.reduce(tree_runs, lambda run: run[0], reduced_tree, 5)
    assert {key: len(factor.parameters) for key, factor in merged.items()} == {
        "two links": 19,
        "person 1": 128,
        "person 2": 128,
    }
    for key, factor in merged.items():
        serial = rigident.Factor.merge(*[reduced_tree(run) for run in tree_runs if run[0] == key])
        assert sorted(factor.recordings) == sorted(serial.recordings) and factor.rows == serial.rows
        assert_same_information(serial, factor)
