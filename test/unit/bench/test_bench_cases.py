"""What a size on the command line means."""

import pytest

from drone_mesh.bench.cases import FULL, QUICK, Case
from drone_mesh.errors import ConfigurationError


def test_a_size_says_how_many_how_far_apart_and_how_fast():
    assert Case.parse("254/1.5") == Case(254, 1.5, 1.0)
    assert Case.parse("17/6@0") == Case(17, 6.0, 0.0)
    assert Case.parse("17/6@0+fly") == Case(17, 6.0, 0.0, flying=True)
    assert Case.parse("100/6+fly").launch_args()[-1] == "flight:=dynamic"


def test_one_drone_of_a_fleet_is_the_gateway_and_the_others_stand_in_a_square():
    assert Case.parse("17/6").launch_args() == [
        "gateways:=1",
        "routers:=16",
        "gridsize:=4",
        "spacing:=6",
        "real_time_factor:=1",
    ]
    assert Case.parse("254/1").gridsize == 16


@pytest.mark.parametrize(
    "text", ["17", "17/", "/6", "x/6", "17/6@", "17/6@fast", "1.5/6", "17/6+hop"]
)
def test_an_invalid_size_is_refused_with_an_example(text):
    with pytest.raises(ConfigurationError, match="such as 100/6"):
        Case.parse(text)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("255/6", "at most 254"),
        ("17/0", "spacing"),
        ("17/nan", "spacing"),
        ("17/6@-1", "real-time factor"),
        ("17/6@inf", "real-time factor"),
    ],
)
def test_a_fleet_that_the_factory_would_refuse_is_refused_with_the_reason(text, why):
    with pytest.raises(ConfigurationError, match=why):
        Case.parse(text)


def test_the_quick_sizes_are_among_the_full_ones():
    assert set(QUICK) <= set(FULL)
