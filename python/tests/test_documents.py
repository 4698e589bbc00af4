"""The commands of docs/python.md and of the package's README run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import EXAMPLES, ROOT

import rigident


def blocks(path: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


def test_the_page_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    found = blocks(ROOT / "docs" / "python.md")
    assert len(found) == 3
    for block in found:
        exec(block, names)
    assert isinstance(names["result"], rigident.Result)


def test_the_readme_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    (block,) = blocks(ROOT / "python" / "README.md")
    exec(block, {})


def test_the_page_names_the_functions() -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    for call in re.findall(r"\| `(Factor|Model|plan)\.?(\w*)\(", page):
        owner, name = call
        assert not name or hasattr(getattr(rigident, owner), name), call
    for name in ("identify", "command", "Factor", "Model", "plan"):
        assert f"`{name}" in page and hasattr(rigident, name)
