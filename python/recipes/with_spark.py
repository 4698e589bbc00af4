"""Reduces a collection of recordings to one factor a body, on the executors of Spark.

A task that an executor died with is done again elsewhere. As a recording counts once, that changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Any

import rigident
from pyspark import RDD


def bodies(
    recordings: RDD[Any], key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor]
) -> RDD[tuple[Hashable, rigident.Factor]]:
    """Returns pairs of a key and the factor of all recordings that have it; `factor` reduces one of them."""

    def reduced(part: Iterable[Any]) -> Iterable[tuple[Hashable, rigident.Factor]]:
        return rigident.Factor.merge_by_key((key(one), factor(one)) for one in part).items()

    return recordings.mapPartitions(reduced).reduceByKey(rigident.Factor.merge)
