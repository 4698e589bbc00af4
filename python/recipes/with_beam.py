"""Reduces a collection of recordings to one factor a body, in a pipeline of Beam.

A runner may do a bundle again, and merge in any grouping. As a recording counts once, that changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Any

import apache_beam as beam
import rigident

# The number of factors that wait before they are merged.
WAITING = 100


class Merge(beam.CombineFn):
    """Merges factors; what it carries are those that wait."""

    def create_accumulator(self) -> list[rigident.Factor]:
        return []

    def add_input(self, waiting: list[rigident.Factor], factor: rigident.Factor) -> list[rigident.Factor]:
        return self._short([*waiting, factor])

    def merge_accumulators(self, several: Iterable[list[rigident.Factor]]) -> list[rigident.Factor]:
        return self._short([factor for waiting in several for factor in waiting])

    def extract_output(self, waiting: list[rigident.Factor]) -> rigident.Factor:
        return rigident.Factor.merge(*waiting)

    def _short(self, waiting: list[rigident.Factor]) -> list[rigident.Factor]:
        return waiting if len(waiting) < WAITING else [rigident.Factor.merge(*waiting)]


def bodies(
    recordings: beam.PCollection, key: Callable[[Any], Hashable], factor: Callable[[Any], rigident.Factor]
) -> beam.PCollection:
    """Returns pairs of a key and the factor of all recordings that have it; `factor` reduces one of them."""
    pairs = recordings | "reduce" >> beam.Map(lambda one: (key(one), factor(one)))
    return pairs | "merge" >> beam.CombinePerKey(Merge())
