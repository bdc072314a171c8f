"""Intervals, tests and censored times, against figures that can be checked by hand."""

from __future__ import annotations

import math
import random

import pytest

from drone_mesh.lab.statistics import (
    holm,
    kaplan_meier,
    mean_interval,
    paired_difference,
    share_interval,
    survival,
)


def test_the_interval_of_a_mean_holds_the_true_mean_in_about_95_of_100_samples() -> None:
    rng = random.Random(1)
    hits = 0
    for _ in range(100):
        found = mean_interval([rng.expovariate(0.1) for _ in range(40)])
        hits += found.low <= 10.0 <= found.high
    assert 88 <= hits <= 100


@pytest.mark.parametrize("values", [[3.0] * 6, [0.3] * 5 + [0.1 + 0.2]])
def test_values_that_differ_by_rounding_only_have_an_interval_of_no_width(
    values: list[float],
) -> None:
    found = mean_interval(values)
    assert found.low == found.value == found.high == pytest.approx(values[0])


@pytest.mark.parametrize("values", [[0.0] * 30 + [1.0], [0.0] * 4 + [1e-9], [5.0] * 5 + [1e9]])
def test_a_single_value_that_differs_leaves_a_finite_interval(values: list[float]) -> None:
    found = mean_interval(values)
    assert -math.inf < found.low <= found.value <= found.high < math.inf


@pytest.mark.parametrize("values", [[4.0], [3.0, 5.0], [4.0, 4.0]])
def test_a_few_values_have_a_mean_and_no_interval(values: list[float]) -> None:
    found = mean_interval(values)
    assert found.value == 4.0
    assert math.isnan(found.low)
    assert str(found) == "4"


def test_no_value_is_a_dash() -> None:
    assert str(mean_interval([])) == "-"


def test_a_share_has_wilsons_interval() -> None:
    found = share_interval(45, 50)
    assert (round(found.low, 3), round(found.high, 3)) == (0.786, 0.957)
    assert share_interval(50, 50).high == 1.0
    assert share_interval(50, 50).low < 0.95


def test_a_paired_difference_sees_what_two_means_hide() -> None:
    rng = random.Random(2)
    base = [rng.uniform(0, 1000) for _ in range(30)]
    found = paired_difference(base, [value - 1.0 - rng.random() for value in base])
    assert found.difference.high < -1.0
    assert found.p < 1e-6


def test_no_difference_at_all_has_p_1() -> None:
    assert paired_difference([1.0, 2.0], [1.0, 2.0]).p == 1.0
    assert math.isnan(paired_difference([], []).p)


def test_holm_multiplies_the_smallest_by_the_number_of_tests() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    adjusted = holm([0.02, math.nan])
    assert adjusted[0] == 0.02
    assert math.isnan(adjusted[1])


def test_kaplan_meier_counts_only_those_still_watched() -> None:
    """Events at 1 and 3, one censored at 2: the step at 3 is one of two, not one of three."""
    assert kaplan_meier([1, 2, 3, 4], [True, False, True, False]) == [
        (0.0, 1.0), (1, 0.75), (3, 0.375),
    ]  # fmt: skip


def test_censored_runs_are_never_averaged_in_as_their_end() -> None:
    found = survival([10, 20, 240, 240], [True, True, False, False])
    assert (found.events, found.censored) == (2, 2)
    assert found.median == 20
    assert found.until == 240
    assert found.restricted_mean.value == pytest.approx((10 + 20 + 240 + 240) / 4)
    assert math.isnan(survival([10, 240, 240], [True, False, False]).median)
