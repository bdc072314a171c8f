"""Fences: where a drone may be, which ways it may take, and how it comes back inside."""

from __future__ import annotations

import math
import random

import pytest

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.drone.fence import CLEAR_M, Fence, Rule, Turn, Zone
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.way_round import MOST_LEGS, way_round
from drone_mesh.errors import ConfigurationError

SQUARE = ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0))
U = ((0, 0), (40, 0), (40, 40), (20, 40), (20, 15), (10, 15), (10, 40), (0, 40))
YARD = Zone("yard", (SQUARE,), highest_m=8.0)
HOLE = Zone("yard", (SQUARE, ((8, 8), (12, 8), (12, 12), (8, 12))))
TOWER = Zone.circle("tower", (5.0, 8.0), 2.0, inside=False)
SHED = Zone("shed", (((13, 13), (17, 13), (17, 17), (13, 17)),), highest_m=3.0)
BRIDGE = Zone("bridge", (((9, -1), (11, -1), (11, 21), (9, 21)),), lowest_m=3.0)
HEDGE = Zone("hedge", (((-2, 5), (-1, 5), (-1, 15), (-2, 15)),))
PEN = Zone("pen", (((-9, 3), (-2, 3), (-2, 17), (-9, 17), (-9, 16), (-3, 16), (-3, 4), (-9, 4)),))
CAGE = Zone(
    "cage", (((-9, 3), (-2, 3), (-2, 17), (-9, 17)), ((-8, 4), (-3, 4), (-3, 16), (-8, 16)))
)
NEXT_YARD = Zone("next", (((20, 5), (40, 5), (40, 15), (20, 15)),))
STAR = ((0, 0), (10, 10), (10, 0), (0, 10))


@pytest.mark.parametrize(
    ("inside", "outside", "place", "why_not"),
    [
        ([YARD], [], (10, 10, 0), ""),
        ([YARD], [], (10, 10, 8), ""),
        ([YARD], [], (21, 10, 0), "outside fence yard"),
        ([YARD], [], (10, 10, 8.5), "above fence yard: 8.5 m, and it ends at 8 m"),
        ([Zone("up", (SQUARE,), 5.0)], [], (1, 1, 0), "below fence up: 0 m, and it ends at 5 m"),
        ([Zone("turned", (SQUARE[::-1],))], [], (10, 10, 0), ""),
        ([Zone("closed", ((*SQUARE, SQUARE[0]),))], [], (10, 10, 0), ""),
        ([HOLE], [], (10, 10, 0), "outside fence yard"),
        ([HOLE], [], (7, 10, 0), ""),
        ([], [HOLE], (10, 10, 0), ""),
        ([], [TOWER], (5, 9.9, 100), "inside fence tower, which drones stay out of"),
        ([], [TOWER], (5, 10.1, 0), ""),
        ([], [SHED], (15, 15, 2), "inside fence shed, which drones stay out of"),
        ([], [SHED], (15, 15, 4), ""),
        ([YARD, NEXT_YARD], [], (30, 10, 9), ""),
        ([YARD, NEXT_YARD], [], (30, 1, 0), "outside fence yard or next"),
        ([YARD], [SHED], (15, 15, 0), "inside fence shed, which drones stay out of"),
        ([], [], (1e6, 0, 0), ""),
    ],
)  # fmt: skip
def test_a_fence_says_why_a_drone_may_not_be_at_a_place(inside, outside, place, why_not):
    assert Fence.of(inside, outside).why_not(place) == why_not


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Zone("a", (STAR,)), "cross"),
        (lambda: Zone("a", (((0, 0), (1, 1), (0, 0), (0, 0)),)), "2 different corners"),
        (lambda: Zone("a", (((0, 0), (1, 1), (2, 2)),)), "in a line"),
        (lambda: Zone("a", (SQUARE,), 5.0, 5.0), "least height"),
        (lambda: Zone.circle("a", (0, 0), 0.0, inside=True), "radius"),
        (lambda: Zone("a", (tuple((n, n % 2 + n * n) for n in range(600)),)), "corners"),
        (lambda: Zone("a", ((),)), "0 different corners"),
    ],
)
def test_what_encloses_no_clear_area_is_refused(make, words):
    with pytest.raises(ConfigurationError, match=words):
        make()


@pytest.mark.parametrize(
    ("inside", "outside", "start", "goal", "round_it", "highest_m"),
    [
        ([YARD], [], (1, 1, 0), (19, 19, 0), 0, 7.5),  # 12 m as usual, but the fence ends at 8 m
        ([Zone("u", (U,))], [], (5, 38, 0), (25, 38, 0), 2, 10),
        ([], [TOWER], (0, 8, 0), (10, 8, 0), 2, 5),
        ([], [SHED], (12, 15, 0), (18, 15, 0), 0, 3.5),  # over it
        ([], [BRIDGE], (5, 10, 0), (15, 10, 0), 0, 2.5),  # under it
        ([], [BRIDGE], (5, 10, 4), (15, 10, 4), 2, 9),  # it starts too high for that: round it
        ([YARD, NEXT_YARD], [], (19, 1, 0), (30, 6, 0), 1, 6.0),  # from one to the other
        ([YARD], [TOWER], (-3, 8, 0), (10, 8, 0), 3, 6.5),  # from outside first to the border
        ([YARD], [HEDGE], (-5, 10, 0), (10, 10, 0), 1, 7.5),  # from outside, not through another
        ([YARD], [PEN], (-5, 10, 0), (10, 10, 0), 4, 7.5),  # out of the pen, and round it
        ([YARD], [CAGE], (-5, 10, 0), (10, 10, 0), None, 0),
        ([YARD], [], (10, 10, 12), (10, 11, 0), 0, 12),  # down from above it
        ([], [TOWER], (5, 8, 0), (0, 8, 0), 1, 2.5),  # out of the area to keep out of
        ([YARD], [BRIDGE], (5, 10, 3.5), (15, 10, 3.5), None, 0),  # on both sides to the border
        ([Zone("a", (SQUARE,)), Zone.circle("b", (40, 10), 5.0, True)], [], (1, 1, 0), (40, 10, 0),
         None, 0),
        ([YARD], [], (1, 1, 0), (21, 1, 0), None, 0),
    ],
)  # fmt: skip
def test_a_flight_goes_round_over_or_under_and_stays_inside(
    inside, outside, start, goal, round_it, highest_m
):
    fence = Fence.of(inside, outside)
    path = Obstacles((), fence=fence).plan_flight(start, goal, 0.0, 2.0)
    if round_it is None:
        assert path is None
        return
    assert path is not None
    assert len(path.around) == round_it
    assert max(corner[2] for corner in path.waypoints) == pytest.approx(highest_m, abs=0.1)
    outside_at = [
        n for n in range(1001) if fence.why_not(path.position_at(path.duration_s * n / 1e3))
    ]
    assert outside_at == list(range(len(outside_at)))  # only until it is inside
    assert not outside_at or fence.why_not(start)
    assert path.position_at(path.duration_s) == goal


def test_a_body_is_above_an_area_once_its_underside_is():
    of_centre = Fence.of([YARD], [SHED, BRIDGE]).raised(0.05)
    assert [bool(of_centre.why_not((15.0, 15.0, z))) for z in (3.04, 3.06)] == [True, False]
    assert [bool(of_centre.why_not((5.0, 5.0, z))) for z in (8.04, 8.06)] == [False, True]
    assert [bool(of_centre.why_not((10.0, 5.0, z))) for z in (2.9, 3.0)] == [False, True]


def test_a_way_through_a_corner_into_an_area_passes_it():
    """As rounded, it meets neither of the two edges there."""
    kite = Zone("kite", (((0.2, 1.4), (5.2, -1.6), (6.2, 8.4), (-1.8, 6.4)),))
    way = [(-5.2, 1.2, 0.0), (16.4, 2.0, 0.0)]
    assert Fence.of([], [kite]).why_not_straight(way) == "its way passes fence kite"


def test_random_flights_past_boxes_and_fences_never_leave():
    rng = random.Random(7)
    fence = Fence.of([Zone("u", (U,), highest_m=9.0)], [TOWER, SHED, BRIDGE])
    obstacles = Obstacles([Box((30.0, 20.0, 2.0), (4.0, 4.0, 4.0))], fence=fence)
    flown = 0
    for _ in range(60):
        start, goal = ((rng.uniform(0, 40), rng.uniform(0, 40), rng.choice([0, 2])) for _ in "ab")
        path = obstacles.plan_flight(start, goal, 0.0, 2.0)
        if fence.why_not(goal):
            assert path is None
        elif path is not None and not fence.why_not(start):
            flown += 1
            for n in range(401):
                place = path.position_at(path.duration_s * n / 400)
                assert not fence.why_not(place)
                assert obstacles.is_free(place)
    assert flown > 10


def test_a_way_round_many_corners_asks_of_few_legs():
    """A pilot sends its autopilot nothing meanwhile."""
    lake = Zone.circle("lake", (0.0, 0.0), 30.0, inside=False)
    (rule,) = Fence.of([], [Zone("lake", lake.rings)]).rules  # 64 turns
    asked = []

    class Asked:
        turns = rule.turns

        def meets(self, a, b):
            asked.append(a)
            return rule.meets(a, b)

    way = way_round([Asked()], (-40.0, 0.0), (40.0, 0.0), 5.0)
    assert way is not None
    assert len(asked) < 1200  # of the 2145 between two of its corners


@pytest.mark.parametrize("seed", range(3))
def test_a_search_among_many_areas_ends(monkeypatch, seed):
    """Also the one for a way that there is not: a Pi does nothing else meanwhile."""
    rng = random.Random(seed)
    corners = [(rng.uniform(0, 99), rng.uniform(0, 99)) for _ in range(40)]
    areas = [Zone("", (((x, y), (x + 20, y), (x + 20, y + 20), (x, y + 20)),)) for x, y in corners]
    island = Zone("", (((300, 0), (310, 0), (310, 10)),))
    asked = []
    meets = Rule.meets
    monkeypatch.setattr(Rule, "meets", lambda rule, a, b: asked.append(a) or meets(rule, a, b))
    fence = Fence.of([*areas, island], [])
    assert way_round(fence.rules, corners[0], (309.0, 2.0), 0.0) is None
    assert len(asked) <= MOST_LEGS + 1


@pytest.mark.parametrize("beside_m", [None, 0.1])
def test_the_shortest_way_is_found_among_ways_that_touch_corners(monkeypatch, beside_m):
    """Between any places, and between places nearer to an edge than a way round turns."""
    rng = random.Random(3)
    found = []
    for _ in range(40):
        zones = [
            Zone(str(n), (tuple(_jagged(rng, rng.uniform(0, 60), rng.uniform(0, 60))),))
            for n in range(4)
        ]
        ends = [(rng.uniform(-5, 65), rng.uniform(-5, 65)) for _ in "ab"]
        if beside_m is not None:
            ends = [_beside(*rng.choice(rng.choice(zones).edges), beside_m) for _ in "ab"]
        found.append((Fence.of([], zones).rules, *ends))
    ways = [way_round(rules, a, b, 5.0) for rules, a, b in found]
    monkeypatch.setattr(Turn, "is_touched_from", lambda *_places: True)
    for way, (rules, a, b) in zip(ways, found):
        assert _metres(a, way, b) == pytest.approx(_metres(a, way_round(rules, a, b, 5.0), b))


def _jagged(rng, x, y):
    for n in range(12):
        metres = rng.uniform(3.0, 12.0)
        yield x + metres * math.cos(n * math.tau / 12), y + metres * math.sin(n * math.tau / 12)


def _beside(one, other, metres):
    """Outside the middle of an edge of a ring that turns left."""
    (x, y), (dx, dy) = one, (other[0] - one[0], other[1] - one[1])
    share = metres / math.hypot(dx, dy)
    return x + dx / 2 + share * dy, y + dy / 2 - share * dx


def _metres(start, way, end):
    places = [start, *way, end] if way is not None else []
    return sum(map(math.dist, places, places[1:]))


def test_without_a_fence_flights_are_as_before():
    start, goal = (0.0, 0.0, 0.0), (30.0, 0.0, 0.0)
    assert Obstacles(()).plan_flight(start, goal, 1.0, 2.0) == FlightPath(start, goal, 1.0, 2.0)


@pytest.mark.parametrize(
    ("fence", "place", "nearest"),
    [
        (Fence.of([YARD], []), (10, 10, 0), (10, 10, 0)),
        (Fence.of([YARD], []), (25, 10, 2), (20 - CLEAR_M, 10, 2)),
        (Fence.of([YARD], []), (23, 24, 2), (20 - CLEAR_M, 20 - CLEAR_M, 2)),
        (Fence.of([], [SHED]), (15, 14, 0), (15, 13 - CLEAR_M, 0)),
        (Fence.of([YARD], []), (10, 10, 9), None),
    ],
)
def test_the_nearest_place_inside_is_clear_of_the_border(fence, place, nearest):
    found = fence.nearest_inside(place)
    assert found == (None if nearest is None else pytest.approx(nearest, abs=1e-9))


def test_a_circle_is_off_by_less_than_two_thousandths_and_to_the_safe_side():
    for inside in (True, False):
        zone = Zone.circle("c", (1.0, 2.0), 100.0, inside)
        for turn in range(500):
            on_edge = [(1 + r * math.cos(turn), 2 + r * math.sin(turn), 0.0) for r in (99.8, 100.2)]
            inner, outer = map(zone.surrounds, on_edge)
            assert (inner, outer) in (
                [(True, False), (False, False)] if inside else [(True, False), (True, True)]
            )
