"""Reduces a collection of recordings to one factor a body, on the workers of Dask.

Dask shares recordings out, does again what a worker that died had done, and merges what comes back. Nothing else is needed: merging
is associative, a factor grows by some 200 bytes a recording, and a recording counts once, however often it is reduced.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Any

import dask.bag
import rigident


def bodies(
    recordings: dask.bag.Bag, key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor]
) -> dask.bag.Bag:
    """Returns pairs of a key and the factor of all recordings that have it; `factor` reduces one of them."""

    def reduced(part: Iterable[Any]) -> Iterable[tuple[Hashable, rigident.Factor]]:
        return rigident.Factor.merge_by_key((key(one), factor(one)) for one in part).items()

    def added(total: rigident.Factor | None, pair: tuple[Hashable, rigident.Factor]) -> rigident.Factor:
        return combined(total, pair[1])

    def combined(total: rigident.Factor | None, other: rigident.Factor) -> rigident.Factor:
        return other if total is None else rigident.Factor.merge(total, other)

    pairs = recordings.map_partitions(reduced)
    return pairs.foldby(lambda pair: pair[0], binop=added, initial=None, combine=combined)
