"""A short way that sees enough: an open path over a graph whose places each see a set of samples.

The problem (a generalised watchman route) is NP-hard; this is a heuristic. A path is a list of stops joined
by shortest ways, and everything that any place along it sees counts. Stops are put in one by one, each where
what it newly sees is worth its detour; the order is then improved as a tour's is, and stops that the rest
makes superfluous are taken out. From there, again and again, some stops are taken away and made up for in
another way, with another weight of gain against detour and some places favoured at random, and the shorter
path is kept (large neighbourhood search). Everything is a function of the problem and the random generator;
searches end by counting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, UInt64
from numpy import ndarray

from hgs_core.errors import SceneError
from hgs_core.evaluation.floor_graph import FloorGraph
from hgs_core.native import kernels

_EXPONENTS: Final = (0.7, 1.0, 1.4, 2.0)
"""Powers of the gain, of which the detour's has one."""
_OFFSETS_M: Final = (0.1, 0.4, 1.0)
"""Added to the detour [m]: what is on the way is not infinitely better than what is almost."""
_LOOKED_AT: Final = 6
"""Of the best stops by what is seen at the stop, so many are compared by what is seen along the detour."""
_ACCEPTED: Final = 1.02
"""The search goes on from paths that are longer than the best by at most this factor."""
_LIKINGS: Final = (0.0, 0.0, 0.0, 0.2, 0.6)
"""Standard deviations of the logarithm of each place's random worth, drawn anew for every attempt."""
_KEPT_LEGS: Final = 30_000


@dataclass(frozen=True, kw_only=True)
class CoveringPath:
    """Places to go to in order, the start first, joined by shortest ways."""

    stops: tuple[int, ...]
    length_m: float
    n_seen: int
    """Samples that some place along it sees."""


class CoverProblem:
    """What the places of `graph` see, `sees` packed by `packed`, and where the path starts."""

    def __init__(self, graph: FloorGraph, sees: UInt64[ndarray, "n n_words"], start: int) -> None:
        self.graph = graph
        self.sees = sees
        self.start = start
        self._legs: dict[tuple[int, int], UInt64[ndarray, " n_words"]] = {}

    @property
    def n_visible(self) -> int:
        """Samples that any place sees."""
        return _count(np.bitwise_or.reduce(self.sees, axis=0))

    def length_m(self, stops: Sequence[int]) -> float:
        return float(self.graph.lengths_m[stops[:-1], stops[1:]].sum())

    def seen(self, stops: Sequence[int]) -> UInt64[ndarray, " n_words"]:
        """What the places along a path see together."""
        seen = self.sees[stops[0]].copy()
        for begin, end in pairwise(stops):
            seen |= self.leg(begin, end)
        return seen

    def leg(self, begin: int, end: int) -> UInt64[ndarray, " n_words"]:
        """What the places along the shortest way between two see together."""
        known = self._legs.get((begin, end))
        if known is None:
            if len(self._legs) >= _KEPT_LEGS:
                self._legs.clear()
            known = np.bitwise_or.reduce(self.sees[self.graph.way(begin, end)], axis=0)
            self._legs[begin, end] = known
        return known

    def path(self, stops: Sequence[int]) -> CoveringPath:
        return CoveringPath(
            stops=tuple(stops), length_m=self.length_m(stops), n_seen=_count(self.seen(stops))
        )


def packed(seen: Bool[ndarray, "n n_samples"]) -> UInt64[ndarray, "n n_words"]:
    """64 samples a word, as `CoverProblem` takes them."""
    padded = np.pad(seen, ((0, 0), (0, -seen.shape[1] % 64)))
    return np.packbits(padded, axis=1).view(np.uint64)


def covering_path(
    problem: CoverProblem,
    n_wanted: int,
    *,
    rng: np.random.Generator,
    rounds: int,
    begin_with: Sequence[Sequence[int]] = (),
) -> CoveringPath:
    """A short path from the problem's start that sees `n_wanted` samples.

    `begin_with` holds paths for other numbers of samples to begin the search with, besides those that are
    put together from nothing. Raises `SceneError` where all places together see fewer.
    """
    if problem.n_visible < n_wanted:
        raise SceneError(
            f"all places together see {problem.n_visible} samples of the {n_wanted} wanted: "
            "ask for a lower level"
        )
    indifferent = np.ones(len(problem.sees))
    begun = [
        _settled(problem, _grown(problem, [problem.start], n_wanted, exponent, offset, indifferent), n_wanted)
        for exponent in _EXPONENTS
        for offset in _OFFSETS_M
    ]
    for stops in begin_with:
        grown = _grown(problem, list(stops), n_wanted, 1.0, _OFFSETS_M[0], indifferent)
        begun.append(_settled(problem, grown, n_wanted))
    best = current = min(begun, key=problem.length_m)
    for _ in range(rounds):
        left = _without_some(current, rng)
        exponent, offset = float(rng.choice(_EXPONENTS)), float(rng.choice(_OFFSETS_M))
        liking = np.exp(float(rng.choice(_LIKINGS)) * rng.standard_normal(len(problem.sees)))
        grown = _grown(problem, left, n_wanted, exponent, offset, liking)
        tried = _settled(problem, grown, n_wanted)
        length = problem.length_m(tried)
        if length < problem.length_m(best) - 1e-9:
            best = tried
        if length < _ACCEPTED * problem.length_m(best):
            current = tried
    return problem.path(best)


def _grown(
    problem: CoverProblem,
    stops: list[int],
    n_wanted: int,
    exponent: float,
    offset_m: float,
    liking: Float[ndarray, " n"],
) -> list[int]:
    """The path with stops put in until it sees `n_wanted` samples; `liking` multiplies a place's worth."""
    stops = list(stops)
    seen = problem.seen(stops)
    while (missing := n_wanted - _count(seen)) > 0:
        gains = np.minimum(_counts(problem.sees & ~seen), missing)
        detours, after = _cheapest_insertions(problem.graph.lengths_m, stops)
        scores = liking * gains**exponent / (detours + offset_m)
        candidates = np.argsort(-scores, kind="stable")[:_LOOKED_AT]
        true_scores = []
        for candidate in candidates[scores[candidates] > 0]:
            along = problem.leg(stops[after[candidate]], int(candidate))
            if after[candidate] + 1 < len(stops):
                along = along | problem.leg(int(candidate), stops[after[candidate] + 1])
            gain = min(_count(along & ~seen), missing)
            true_scores.append(liking[candidate] * gain**exponent / (detours[candidate] + offset_m))
        chosen = int(candidates[np.argmax(true_scores)])
        stops.insert(after[chosen] + 1, chosen)
        seen = problem.seen(stops)
    return stops


def _cheapest_insertions(
    lengths_m: Float[ndarray, "n n"], stops: list[int]
) -> tuple[Float[ndarray, " n"], ndarray]:
    """For every place the least that it adds to the path, and the index of the stop to put it after."""
    rows = lengths_m[stops]
    added = rows.copy()
    added[:-1] += rows[1:] - lengths_m[stops[:-1], stops[1:]][:, None]
    after = np.argmin(added, axis=0)
    return np.maximum(added[after, np.arange(added.shape[1])], 0.0), after


def _settled(problem: CoverProblem, stops: list[int], n_wanted: int) -> list[int]:
    """The path in a better order and without superfluous stops, as long as that makes it shorter."""
    length = np.inf
    while (shorter := problem.length_m(stops)) < length - 1e-9:
        length = shorter
        stops = _pruned(problem, _reordered(problem, stops, n_wanted), n_wanted)
    return stops


def _reordered(problem: CoverProblem, stops: list[int], n_wanted: int) -> list[int]:
    """As a tour; unless other ways between the stops see too little, or nothing is won."""
    if len(stops) < 3:
        return stops
    order, _ = kernels.open_tour(np.ascontiguousarray(problem.graph.lengths_m[np.ix_(stops, stops)]), -1)
    tour = [stops[index] for index in order]
    if problem.length_m(tour) < problem.length_m(stops) - 1e-9 and _count(problem.seen(tour)) >= n_wanted:
        return tour
    return stops


def _pruned(problem: CoverProblem, stops: list[int], n_wanted: int) -> list[int]:
    """Without stops that are not needed, those that save most taken out first."""
    while True:
        shorter = [stops[:index] + stops[index + 1 :] for index in range(1, len(stops))]
        for without in sorted(shorter, key=problem.length_m):
            if _count(problem.seen(without)) >= n_wanted:
                stops = without
                break
        else:
            return stops


def _without_some(stops: list[int], rng: np.random.Generator) -> list[int]:
    """The path with up to half of its stops taken away, one after the other or here and there; the start
    stays."""
    if len(stops) < 2:
        return list(stops)
    count = int(rng.integers(1, max(2, len(stops) // 2) + 1))
    if rng.random() < 0.5:
        first = int(rng.integers(1, max(2, len(stops) - count + 1)))
        return stops[:first] + stops[first + count :]
    gone = set((1 + rng.permutation(len(stops) - 1)[:count]).tolist())
    return [stop for index, stop in enumerate(stops) if index not in gone]


def _counts(words: UInt64[ndarray, "n n_words"]) -> ndarray:
    return np.bitwise_count(words).sum(axis=1, dtype=np.int64)


def _count(words: UInt64[ndarray, " n_words"]) -> int:
    return int(np.bitwise_count(words).sum(dtype=np.int64))
