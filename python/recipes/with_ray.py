"""Reduces a collection of recordings to one factor a body, by tasks of Ray.

Ray starts a task again whose worker died. As a recording counts once, that changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import ray
import rigident


@ray.remote
def _reduced(
    part: Sequence[Any], key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor]
) -> dict[Hashable, rigident.Factor]:
    return rigident.Factor.merge_by_key((key(one), factor(one)) for one in part)


@ray.remote
def _merged(*shares: dict[Hashable, rigident.Factor]) -> dict[Hashable, rigident.Factor]:
    return rigident.Factor.merge_by_key(pair for share in shares for pair in share.items())


def bodies(
    recordings: Sequence[Any],
    key: Callable[[Any], Hashable],
    factor: Callable[[Any], rigident.Factor],
    part: int = 100,
) -> dict[Hashable, rigident.Factor]:
    """Returns for each key the factor of all recordings that have it; `factor` reduces one of them, a task `part` of them."""
    shares = [_reduced.remote(recordings[k : k + part], key, factor) for k in range(0, len(recordings), part)]
    # Ten at a time: no worker waits for all, and none holds all.
    while len(shares) > 1:
        shares = [_merged.remote(*shares[k : k + 10]) for k in range(0, len(shares), 10)]
    return ray.get(shares[0]) if shares else {}
