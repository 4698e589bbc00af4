"""What tests share. Paths are of the repository's root, where pytest is started."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"


@pytest.fixture
def bracket() -> dict[str, NDArray[np.float64]]:
    """Columns of docs/examples/bracket.csv."""
    with open(EXAMPLES / "bracket.csv", newline="", encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if not row[0].startswith("#")]
    numbers = np.array(rows[1:], dtype=np.float64)
    return {name: numbers[:, k] for k, name in enumerate(rows[0])}
