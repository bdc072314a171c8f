"""The models of motion, against the distributions that they are known for."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import random
import statistics

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility import KINDS, Area, Mobility, tracks_of
from drone_mesh.mobility.models import reference_point, wander_s, wandering
from drone_mesh.mobility.track import Legs, Loop, Segment, Together, climbing, leg_to, rest

AREA = Area(0.0, 0.0, 40.0, 40.0)
MANY = {node: (20.0, 20.0, 0.0) for node in range(200)}


def tracks(kind, places=MANY, ground=(), area=AREA, seed=1, **numbers):
    return tracks_of(Mobility(kind, **numbers), places, ground, area, seed)


def from_middle(point):
    return math.dist(point[:2], (20.0, 20.0))


def speed(track, t_s):
    return math.hypot(*track.velocity_at(t_s))


# Random waypoint -----------------------------------------------------------------------------


@functools.lru_cache(maxsize=None)
def steady_state_distance():
    """Mean distance from the middle: a point is on a segment, the longer the likelier."""
    rng, weights, total = random.Random(5), 0.0, 0.0
    for _ in range(40_000):
        one, other, share = AREA.point(rng, 0.0), AREA.point(rng, 0.0), rng.random()
        length_m = math.dist(one, other)
        point = [a + (b - a) * share for a, b in zip(one, other)]
        weights += length_m
        total += length_m * from_middle(point)
    return total / weights


@pytest.mark.parametrize("t_s", [0.0, 60.0, 600.0])
def test_random_waypoints_are_in_their_steady_state_at_every_time(t_s):
    drones = {node: (0.0, 0.0, 0.0) for node in range(2000)}
    flown = tracks("random_waypoint", drones, speed_m_s=(0.5, 2.0))
    mean_m = statistics.fmean(from_middle(track.position_at(t_s)) for track in flown.values())
    assert mean_m == pytest.approx(steady_state_distance(), abs=0.5)
    uniform_m = 0.3826 * 40.0  # mean distance of a uniform point in a square from its middle
    assert mean_m < uniform_m - 1.5


@pytest.mark.parametrize("t_s", [0.0, 500.0])
def test_random_waypoint_speeds_are_those_of_the_steady_state(t_s):
    """A slow leg lasts longer: the mean over time is (high - low) / ln(high / low)."""
    drones = {node: (0.0, 0.0, 0.0) for node in range(2000)}
    flown = tracks("random_waypoint", drones, speed_m_s=(0.2, 2.0))
    mean = statistics.fmean(speed(track, t_s) for track in flown.values())
    assert mean == pytest.approx(1.8 / math.log(10.0), rel=0.06)


@pytest.mark.parametrize("t_s", [0.0, 300.0])
def test_the_share_of_drones_that_pause_is_that_of_the_steady_state(t_s):
    drones = {node: (0.0, 0.0, 0.0) for node in range(2000)}
    flown = tracks("random_waypoint", drones, speed_m_s=(1.0, 1.0), pause_s=20.0)
    at_rest = sum(speed(track, t_s) == 0.0 for track in flown.values()) / 2000
    flight_s = 0.5214 * 40.0  # mean distance of two points in a square, at 1 m/s
    assert at_rest == pytest.approx(20.0 / (20.0 + flight_s), abs=0.035)


def test_a_climbing_leg_follows_the_profile_of_the_document():
    up, across, down = climbing(leg_to(10.0, 20.0, (0.0, 0.0, 0.0), (8.0, 0.0, 0.0)), 500.0)
    assert (up.start_s, up.end_s, up.end) == (10.0, 11.0, (0.0, 0.0, 4.0))
    assert (across.end_s, across.end) == (19.0, pytest.approx((8.0, 0.0, 4.0)))
    assert (down.end_s, down.end) == (20.0, pytest.approx((8.0, 0.0, 0.0)))


def test_under_a_ceiling_a_leg_climbs_less_in_the_same_time():
    up, across, down = climbing(leg_to(10.0, 20.0, (0.0, 0.0, 1.0), (8.0, 0.0, 1.0)), 3.0)
    assert (up.end_s, up.end) == (11.0, (0.0, 0.0, 3.0))
    assert (across.end_s, across.end) == (19.0, pytest.approx((8.0, 0.0, 3.0)))
    assert (down.end_s, down.end) == (20.0, pytest.approx((8.0, 0.0, 1.0)))
    level = leg_to(10.0, 20.0, (0.0, 0.0, 4.0), (8.0, 0.0, 4.0))
    assert list(climbing(level, 3.0)) == [level]


def test_level_flights_stay_at_their_height_and_climbing_ones_do_not():
    level = tracks("random_waypoint", height_m=3.0).values()
    climbs = tracks("random_waypoint", climbs=True).values()
    assert {track.position_at(50.0)[2] for track in level} == {3.0}
    assert max(track.position_at(50.0)[2] for track in climbs) > 10.0
    under = tracks("random_waypoint", climbs=True, cruise_height_m=3.0).values()
    assert max(track.position_at(50.0)[2] for track in under) == pytest.approx(3.0)


# Gauss-Markov --------------------------------------------------------------------------------


def gauss_markov_speeds(alpha, steps=2000):
    """Of each drone, one speed per draw; the border is far away."""
    wide = Area(-1e6, -1e6, 2e6, 2e6)
    flown = tracks(
        "gauss_markov",
        {n: MANY[n] for n in range(20)},
        area=wide,
        speed_m_s=(1.0, 3.0),
        alpha=alpha,
    )
    return [[speed(track, step + 0.5) for step in range(steps)] for track in flown.values()]


@pytest.mark.parametrize("alpha", [0.0, 0.5, 0.85])
def test_gauss_markov_has_its_mean_speed_deviation_and_memory(alpha):
    drones = gauss_markov_speeds(alpha)
    speeds = [value for drone in drones for value in drone]
    assert statistics.fmean(speeds) == pytest.approx(2.0, abs=0.02)
    assert statistics.pstdev(speeds) == pytest.approx(0.5, abs=0.02)
    pairs = [(a - 2.0, b - 2.0) for drone in drones for a, b in zip(drone, drone[1:])]
    memory = statistics.fmean(a * b for a, b in pairs) / statistics.fmean(a * a for a, _ in pairs)
    assert memory == pytest.approx(alpha, abs=0.02)


def test_gauss_markov_is_reflected_at_the_border():
    flown = tracks("gauss_markov", speed_m_s=(1.0, 3.0))
    points = [track.position_at(t) for track in flown.values() for t in range(0, 300, 7)]
    assert all(-1e-6 <= value <= 40.0 + 1e-6 for x, y, _z in points for value in (x, y))
    mean_m = statistics.fmean(map(from_middle, points))
    assert mean_m == pytest.approx(0.3826 * 40.0, abs=1.5)  # uniform


# Groups --------------------------------------------------------------------------------------


def test_the_spread_of_a_group_is_that_of_its_circle():
    """At its draws a drone is uniform in the circle: its mean square distance is r^2 / 2."""
    mobility = Mobility("group", radius_m=6.0)
    squares = []
    for node in range(400):
        track = wandering(mobility, random.Random(node))
        at_s = track.leg_at(0.0).end_s + 3 * wander_s(mobility)
        squares.append(math.hypot(*track.position_at(at_s)) ** 2)
        assert math.hypot(*track.position_at(at_s + 0.3 * wander_s(mobility))) <= 6.0
    assert statistics.fmean(squares) == pytest.approx(18.0, rel=0.1)


def test_drones_of_a_group_stay_together_and_groups_move_apart():
    flown = tracks("group", groups=4, radius_m=3.0, speed_m_s=(0.5, 0.5))
    for t_s in (0.0, 100.0, 400.0):
        groups = [
            [flown[node].position_at(t_s) for node in range(first, 200, 4)] for first in range(4)
        ]
        assert max(math.dist(a, b) for group in groups for a in group for b in group) <= 6.0
        assert all(
            0.0 <= value <= 40.0 for group in groups for x, y, _z in group for value in (x, y)
        )
    middles = [tuple(map(statistics.fmean, zip(*group)))[:2] for group in groups]
    assert max(math.dist(a, b) for a, b in itertools.combinations(middles, 2)) > 6.0


def test_the_middle_of_a_group_keeps_the_circle_in_the_area():
    middle = reference_point(Mobility("group", radius_m=5.0), AREA, random.Random(1))
    points = [middle.position_at(t) for t in range(0, 2000, 13)]
    assert all(5.0 <= value <= 35.0 for x, y, _z in points for value in (x, y))


@pytest.mark.parametrize("radius_m", [20.0, 500.0])
def test_a_group_that_does_not_fit_into_the_area_stays_around_its_middle(radius_m):
    flown = tracks("group", groups=2, radius_m=radius_m, height_m=3.0)
    middle = (20.0, 20.0, 3.0)
    for t_s in (0.0, 250.0):
        away_m = [math.dist(track.position_at(t_s), middle) for track in flown.values()]
        assert radius_m / 2 < max(away_m) <= radius_m


def test_a_group_wider_than_the_area_is_deep_moves_along_it():
    middle = reference_point(Mobility("group", radius_m=5.0), Area(0, 0, 40, 8), random.Random(1))
    points = [middle.position_at(t) for t in range(0, 2000, 13)]
    assert {y for _x, y, _z in points} == {4.0}
    assert max(x for x, _y, _z in points) > 30.0


@pytest.mark.parametrize("kind", ["random_waypoint", "gauss_markov", "group", "patrol"])
@pytest.mark.parametrize(
    ("area", "words"),
    [
        (Area(5.0, 5.0, 0.0, 0.0), "above 0"),
        (Area(0.0, 0.0, -5.0, 5.0), "0 or more"),
        (Area(0.0, 0.0, 5.0, math.inf), "finite"),
        (Area(math.nan, 0.0, 5.0, 5.0), "finite"),
    ],
)
def test_an_area_without_room_to_move_is_refused(kind, area, words):
    with pytest.raises(ConfigurationError, match=f"invalid area .*{words}"):
        tracks(kind, area=area)


def test_gauss_markov_on_a_line_is_refused_and_random_waypoints_are_not():
    line = Area(0.0, 3.0, 40.0, 0.0)
    with pytest.raises(ConfigurationError, match="gauss_markov needs a width and a depth above 0"):
        tracks("gauss_markov", area=line)
    assert {t.position_at(9.0)[1] for t in tracks("random_waypoint", area=line).values()} == {3.0}


def test_kinds_that_need_no_area_take_any():
    loop = ((0.0, 0.0), (9.0, 0.0))
    assert tracks("patrol", area=Area(5.0, 5.0, 0.0, 0.0), waypoints=loop)
    assert tracks("oval", area=Area(5.0, 5.0, 0.0, 0.0))


# Patrols -------------------------------------------------------------------------------------


def test_drones_on_patrol_stay_evenly_spaced_on_one_line():
    places = {node: (0.0, 0.0, 0.0) for node in range(1, 11)}
    square = ((0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0))
    flown = tracks("patrol", places, waypoints=square, speed_m_s=(1.0, 1.0), height_m=2.0)
    for t_s in (0.0, 33.0, 1234.5):
        along = sorted(along_rectangle(track.position_at(t_s)) for track in flown.values())
        gaps = [b - a for a, b in zip(along, along[1:])] + [along[0] + 100.0 - along[-1]]
        assert gaps == pytest.approx([10.0] * 10)
    assert all(speed(track, 12.0) == pytest.approx(1.0) for track in flown.values())


def along_rectangle(point):
    x, y, z = (round(value, 9) for value in point)
    assert z == 2.0
    if y == 0.0:
        return x
    if x == 30.0:
        return 30.0 + y
    if y == 20.0:
        return 50.0 + 30.0 - x
    assert x == 0.0
    return 80.0 + 20.0 - y


def test_lanes_sweep_the_whole_area():
    flown = tracks("patrol", {0: (0.0, 0.0, 0.0)}, lanes=4, speed_m_s=(1.0, 1.0))
    points = [flown[0].position_at(t) for t in range(0, 400)]
    assert {round(y) for x, y, _z in points if 1 < x < 39} == {5, 15, 25, 35}
    assert (min(p[0] for p in points), max(p[0] for p in points)) == pytest.approx((0, 40), abs=1)


@pytest.mark.parametrize(("kind", "length_m"), [("oval", 8 + 4 * math.pi), ("eight", 8 * math.pi)])
def test_an_oval_and_an_eight_are_closed_lines_around_the_drones_place(kind, length_m):
    flown = tracks(kind, {3: (7.0, 9.0, 0.0)}, radius_m=2.0, speed_m_s=(1.0, 1.0))[3]
    assert flown.length_m == pytest.approx(length_m, rel=0.005)
    points = [flown.position_at(t * flown.length_m / 400) for t in range(400)]
    middle = [statistics.fmean(values) for values in zip(*points)]
    assert middle[:2] == pytest.approx([7.0, 9.0], abs=0.05)
    assert max(math.dist(a, b) for a, b in zip(points, points[1:])) < length_m / 390


# All models ----------------------------------------------------------------------------------

MOVING = sorted(set(KINDS) - {"none", "trace"})


@pytest.mark.parametrize("kind", MOVING)
def test_a_seed_gives_one_motion_in_whatever_order_it_is_asked_for(kind):
    times = [0.0, 3.3, 17.0, 44.4, 90.0]
    one = {n: [t.position_at(s) for s in times] for n, t in tracks(kind).items()}
    other = {n: [t.position_at(s) for s in reversed(times)] for n, t in tracks(kind).items()}
    assert one == {n: places[::-1] for n, places in other.items()}
    assert one != {n: [t.position_at(s) for s in times] for n, t in tracks(kind, seed=2).items()}


@pytest.mark.parametrize("kind", MOVING)
def test_a_position_is_the_integral_of_the_velocity(kind):
    track = tracks(kind, speed_m_s=(0.5, 1.5), pause_s=2.0)[7]
    step_s, fastest = 0.01, 4.0
    for start_s in (0.0, 25.0, 100.0):
        point = track.position_at(start_s)
        for step in range(1, 500):
            t_s = start_s + step * step_s
            moved = math.dist(point, track.position_at(t_s))
            assert moved <= fastest * step_s + 1e-9
            point = track.position_at(t_s)
        leg = track.leg_at(t_s)
        assert leg.start_s - 1e-9 <= t_s < leg.end_s + 1e-9


def test_a_share_of_the_drones_moves_and_gateways_only_if_they_may():
    places = {node: (1.0, 2.0, 0.0) for node in range(10)}
    assert set(tracks("random_waypoint", places, {0, 1})) == set(range(2, 10))
    assert set(tracks("random_waypoint", places, {0, 1}, gateways=True)) == set(range(10))
    assert len(tracks("random_waypoint", places, {0, 1}, share=0.5)) == 4
    assert tracks("none", places, {0}) == {}


def test_a_further_drone_does_not_change_the_motion_of_the_others():
    few = tracks("random_waypoint", {node: MANY[node] for node in range(5)})
    more = tracks("random_waypoint", {node: MANY[node] for node in range(6)})
    assert all(few[n].position_at(70.0) == more[n].position_at(70.0) for n in few)


@pytest.mark.parametrize(
    ("number", "value", "words"),
    [
        ("speed_m_s", (0.0, 1.0), "speed"),
        ("speed_m_s", (2.0, 1.0), "the lower first"),
        ("share", 1.5, "0..1"),
        ("alpha", -0.1, "0..1"),
        ("radius_m", 0.0, "above 0"),
        ("speed_m_s", (1.0, math.inf), "two speeds above 0"),
        ("speed_m_s", 0.3, "two speeds above 0"),
        ("speed_m_s", (0.3, 0.4, 0.5), "two speeds above 0"),
        ("speed_m_s", ("slow", "fast"), "two speeds above 0"),
        ("pause_s", math.nan, "0 or more"),
        ("update_s", math.inf, "above 0"),
        ("groups", 2.5, "a whole number"),
        ("height_m", math.nan, "0..500"),
        ("height_m", -3.0, "0..500"),
        ("height_m", "high", "0..500"),
        ("cruise_height_m", math.nan, "from height_m, 0, to 500"),
        ("waypoints", ((1.0, math.nan), (1.0, 1.0)), "pairs x, y of finite numbers"),
        ("waypoints", ((1.0, 1.0, 2.0), (5.0, 1.0, 2.0)), "pairs x, y"),
        ("knots", {1: ()}, "knots of drone 1: must be t, x, y and z"),
        ("knots", {1: ((0.0, 1e308, 1.0, 0.0),)}, "knots of drone 1: must be t, x, y and z"),
        ("knots", {1: ((0.0, 10**400, 1.0, 0.0),)}, "knots of drone 1: must be t, x, y and z"),
        ("knots", {1: ((0.0, 1.0, 1.0),)}, "knots of drone 1: must be t, x, y and z"),
        ("knots", {1: ((0.0, math.nan, 1.0, 0.0),)}, "knots of drone 1: .* finite"),
        ("knots", {1: ((2.0, 1.0, 1.0, 0.0), (1.0, 1.0, 1.0, 0.0))}, "t must not fall"),
        ("waypoints", ((1.0, 1.0), (1.0, 1.0)), "two different places"),
        ("kind", "teleport", "use one of none, random_waypoint"),
    ],
)
def test_a_number_that_no_model_can_use_is_refused(number, value, words):
    mobility = dataclasses.replace(Mobility("patrol"), **{number: value})
    with pytest.raises(ConfigurationError, match=words):
        tracks_of(mobility, MANY, (), AREA, 1)


def test_a_ceiling_below_the_flights_is_refused():
    with pytest.raises(ConfigurationError, match="cruise_height_m 3.0: must be from height_m, 5,"):
        tracks("random_waypoint", climbs=True, height_m=5.0, cruise_height_m=3.0)


# Tracks --------------------------------------------------------------------------------------


def test_a_drone_rests_after_its_last_leg():
    track = Legs([leg_to(0.0, 2.0, (0.0, 0.0, 0.0), (4.0, 0.0, 0.0))])
    assert track.position_at(1.0) == (2.0, 0.0, 0.0)
    assert track.position_at(50.0) == (4.0, 0.0, 0.0)
    assert track.velocity_at(50.0) == (0.0, 0.0, 0.0)


def test_a_track_must_begin_at_time_0_or_before():
    for legs in ([], [rest(0.5, (0.0, 0.0, 0.0))]):
        with pytest.raises(ValueError, match="begins at time 0"):
            Legs(legs)


def test_a_long_track_forgets_its_beginning_and_says_so():
    legs = (
        Segment(float(i), i + 1.0, (float(i), 0.0, 0.0), (1.0, 0.0, 0.0)) for i in itertools.count()
    )
    track = Legs(legs)
    assert track.position_at(5000.5)[0] == 5000.5
    assert track.position_at(4600.5)[0] == 4600.5
    with pytest.raises(ValueError, match="no longer knows 3 s"):
        track.leg_at(3.0)


def test_the_sum_of_two_motions_changes_when_either_does():
    loop = Loop([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)], 1.0)
    slow = Legs([leg_to(0.0, 15.0, (0.0, 5.0, 1.0), (0.0, 20.0, 1.0))])
    leg = Together(loop, slow).leg_at(12.0)
    assert (leg.start_s, leg.end_s) == (10.0, 15.0)
    assert leg.position_at(12.0) == pytest.approx((8.0, 17.0, 1.0))
    assert leg.velocity == pytest.approx((-1.0, 1.0, 0.0))


def test_random_waypoints_can_begin_where_the_drones_stand():
    flown = tracks("random_waypoint", {4: (3.0, 2.0, 0.0)}, steady=False, speed_m_s=(1.0, 1.0))
    assert flown[4].position_at(0.0) == (3.0, 2.0, 0.0)
    assert math.dist(flown[4].position_at(2.0), (3.0, 2.0, 0.0)) == pytest.approx(2.0)
