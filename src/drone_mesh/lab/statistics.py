"""Intervals and tests, by scipy; and the two survival statistics that reports need.

Kaplan-Meier and the restricted mean are thirty lines here: lifelines would bring pandas and six
more packages for these two.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Sequence

import numpy as np
from scipy import stats

RESAMPLES = 2000
CONFIDENCE = 0.95
ROUNDING = 1e-12  # values that differ by less are equal
FEWEST = 5  # resampling fewer values is meaningless
SEED = 1  # for resampling: the same rows produce the same report


def plain(value: float) -> str:
    """Three significant digits, and no powers of ten below a million."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


class Interval(NamedTuple):
    """An estimate with its 95 % confidence interval; NaN where there is none."""

    value: float
    low: float
    high: float
    n: int

    def __str__(self) -> str:
        if math.isnan(self.value):
            return "-"
        if math.isnan(self.low):
            return plain(self.value)
        return f"{plain(self.value)} [{plain(self.low)}, {plain(self.high)}]"


def mean_interval(values: Sequence[float]) -> Interval:
    """Mean, BCa bootstrap."""
    n = len(values)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan, 0)
    value = float(np.mean(values))
    if n < FEWEST:
        return Interval(value, math.nan, math.nan, n)
    if math.isclose(min(values), max(values), rel_tol=ROUNDING):  # BCa is not defined there
        return Interval(value, value, value, n)
    found = stats.bootstrap(
        (np.asarray(values, float),),
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="BCa",
        random_state=np.random.default_rng(SEED),
    )
    low, high = map(float, found.confidence_interval)
    return Interval(value, low, high, n)


def share_interval(successes: int, n: int) -> Interval:
    """A share, Wilson."""
    if n == 0:
        return Interval(math.nan, math.nan, math.nan, 0)
    found = stats.binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / n, float(found.low), float(found.high), n)


class Paired(NamedTuple):
    """Per-seed differences b - a."""

    difference: Interval  # of the mean
    p: float  # Wilcoxon signed-rank, two-sided; 1 where all differences are 0


def paired_difference(a: Sequence[float], b: Sequence[float]) -> Paired:
    """Compare values by seed, in the same order."""
    differences = [y - x for x, y in zip(a, b)]
    interval = mean_interval(differences)
    if not any(differences):
        return Paired(interval, 1.0 if differences else math.nan)
    return Paired(interval, float(stats.wilcoxon(differences).pvalue))


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p values of one family of tests (Holm 1979); NaN is kept and not counted."""
    order = sorted(
        (i for i, p in enumerate(p_values) if not math.isnan(p)), key=p_values.__getitem__
    )
    adjusted = [math.nan] * len(p_values)
    largest = 0.0
    for place, index in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - place) * p_values[index]))
        adjusted[index] = largest
    return adjusted


class Survival(NamedTuple):
    """Times to an event, some of them censored."""

    events: int
    censored: int
    median: float  # Kaplan-Meier; NaN: less than half had the event
    restricted_mean: Interval  # mean time up to `until`
    until: float  # the earliest time at which a run is censored


def survival(times: Sequence[float], seen: Sequence[bool]) -> Survival:
    """`seen[i]`: the event happened at times[i]; otherwise it had not happened by then."""
    events = sum(seen)
    if not times:
        return Survival(0, 0, math.nan, Interval(math.nan, math.nan, math.nan, 0), math.nan)
    censored_at = [t for t, s in zip(times, seen) if not s]
    until = min(censored_at) if censored_at else max(times)
    # No run is censored before `until`, so up to there the mean of the truncated times is exact.
    area = mean_interval([min(t, until) for t in times])
    curve = kaplan_meier(times, seen)
    median = next((time for time, share in curve if share <= 0.5), math.nan)
    return Survival(events, len(times) - events, median, area, until)


def kaplan_meier(times: Sequence[float], seen: Sequence[bool]) -> list[tuple[float, float]]:
    """(time, share without the event) at each time of an event, starting with (0, 1)."""
    curve = [(0.0, 1.0)]
    share = 1.0
    for time in sorted({t for t, s in zip(times, seen) if s}):
        at_risk = sum(t >= time for t in times)
        share *= 1.0 - sum(t == time and s for t, s in zip(times, seen)) / at_risk
        curve.append((time, share))
    return curve
