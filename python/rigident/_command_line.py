"""The command ``rigident``: the whole command line, in this process."""

from __future__ import annotations

import sys

from rigident._rigident import main as _main


def main() -> None:
    """Runs the command line and ends Python with its exit status."""
    sys.exit(_main(["rigident", *sys.argv[1:]]))
