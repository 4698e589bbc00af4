"""The command in the wheel; threads, Ctrl-C."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from conftest import EXAMPLES

import rigident

PROGRAM = Path(sys.executable).with_name("rigident")


def test_the_command_ends_with_its_status() -> None:
    def status(*words: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=60, check=False
        )

    version = status("--version")
    assert version.returncode == 0 and version.stdout.startswith("rigident ")
    assert status("identify", "nowhere.csv").returncode == 2
    assert status("identify", "--no-such-option").returncode == 2
    module = subprocess.run(
        [sys.executable, "-m", "rigident", "--version"], capture_output=True, text=True, timeout=60, check=False
    )
    assert module.stdout == version.stdout


def test_the_command_starts_without_numpy() -> None:
    said = "import sys, rigident._command_line; print('numpy' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, timeout=60, check=True)
    assert ended.stdout.strip() == "False"
    assert set(rigident.__all__) == set(dir(rigident))
    assert all(getattr(rigident, name) is not None for name in rigident.__all__)


def test_any_command_can_be_called() -> None:
    assert rigident.command("--version").output.startswith("rigident ")
    checked = rigident.command("model", "check", EXAMPLES / "two-links.rig.toml", "--json")
    assert checked.status in (0, 1) and checked.output.startswith("{")
    with pytest.raises(rigident.RigidentError) as caught:
        rigident.command("identify", EXAMPLES / "nowhere.csv")
    assert caught.value.status == 2 and caught.value.place is not None
    assert caught.value.place.file is not None and caught.value.place.file.endswith("nowhere.csv")


def test_a_place_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv"
    lines = (EXAMPLES / "bracket.csv").read_text(encoding="utf-8").splitlines()
    lines[40] = lines[40].rsplit(",", 1)[0]
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(rigident.RigidentError, match="line 41") as caught:
        rigident.identify(path)
    assert caught.value.place is not None and caught.value.place.line == 41


def test_other_threads_of_python_run_meanwhile() -> None:
    counted = 0
    over = threading.Event()

    def count() -> None:
        nonlocal counted
        while not over.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    began = time.monotonic()
    rigident.plan.poses(5)
    took = time.monotonic() - began
    over.set()
    thread.join()
    # With the lock held, none; on a busy machine one in ten is enough.
    assert counted > took / 0.001 / 10


def test_two_calls_at_a_time_are_two_answers() -> None:
    found: dict[str, str] = {}

    def identify(name: str) -> None:
        found[name] = rigident.identify(EXAMPLES / name).object["source"]["recording"]

    names = ["bracket.csv", "two-links.csv"]
    threads = [threading.Thread(target=identify, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {"bracket.csv": "bracket", "two-links.csv": "two-links"}


INTERRUPTED = """
import os, signal, threading, time
import rigident
# All is loaded before the signal: Python's own import of numpy is not what is stopped.
rigident.identify("docs/examples/bracket.csv")
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
began = time.monotonic()
try:
    rigident.plan.motion(duration_s=60.0)
except KeyboardInterrupt:
    print("stopped", time.monotonic() - began)
# It is of that call alone.
print(rigident.identify("docs/examples/bracket.csv").status)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
def test_ctrl_c_stops_a_command() -> None:
    root = EXAMPLES.parents[1]
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=120, check=False, cwd=root
    )
    assert ended.returncode == 0, ended.stderr
    first, second = ended.stdout.splitlines()
    word, seconds = first.split()
    # A second before the signal, two for the command to heed it, and a busy machine.
    assert word == "stopped" and float(seconds) < 10, ended.stderr
    assert second == "identified"


def test_the_report_is_shown_in_jupyter() -> None:
    result = rigident.identify(EXAMPLES / "bracket.csv")
    assert result.page.lower().startswith("<!doctype html>")
    shown = result._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and shown.count("<") == 2


def test_unidentified_parameters_have_no_number(tmp_path: Path) -> None:
    # A third of a second of motion tells little.
    lines = (EXAMPLES / "bracket.csv").read_text(encoding="utf-8").splitlines()
    path = tmp_path / "short.csv"
    path.write_text("\n".join(lines[:40]), encoding="utf-8")
    result = rigident.identify(path)
    assert result.exit_status == 1
    with pytest.raises(rigident.NotIdentified, match="not identified"):
        result.values()
    with pytest.raises(ValueError):
        result.value("Ixx")
    assert not result.fit
    with pytest.raises(KeyError, match="the parameters are m"):
        result["mass"]


def test_moments_in_newton_millimetres_give_no_number(tmp_path: Path) -> None:
    header, *rows = (EXAMPLES / "bracket.csv").read_text(encoding="utf-8").splitlines()
    names = header.split(",")
    scaled = [
        ",".join(repr(1e3 * float(c)) if n.endswith("_nm") else c for n, c in zip(names, row.split(","), strict=True))
        for row in rows
    ]
    path = tmp_path / "mm.csv"
    path.write_text("\n".join([header, *scaled]) + "\n", encoding="utf-8")
    result = rigident.identify(path, rig=EXAMPLES / "bracket.rig.toml")
    assert result.status == "implausible" and result["Ixx"].state == "contradicted"
    assert all(p.value is None and p.u95 is None for p in result.parameters)
    derived = (result.mass_kg, result.com_m, result.com_u95_m, result.inertia_com_kgm2, result.inertia_com_u95_kgm2)
    assert all(one is None for one in derived)
    for ask in (lambda: result.value("Ixx"), lambda: result.values(["m"]), result.u95):
        with pytest.raises(rigident.Contradicted):
            ask()
    assert issubclass(rigident.Contradicted, rigident.RigidentError)
    # The numbers of the fit help to find the fault.
    assert result.fit["Ixx"].value > 10 and result.fit["Ixx"].unit == "kg m2"
