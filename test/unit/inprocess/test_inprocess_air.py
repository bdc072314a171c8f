"""The in-process air: what it remembers about links is what the places say."""

import math
import random
from types import SimpleNamespace

import pytest

from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.radio import InProcessAir

MESH = object()  # what arrives goes to the host


class Stone(IDroneEngine):
    """Is where it was put."""

    def __init__(self, place):
        self.place = place

    def set_goal(self, latitude, longitude, height):
        self.place = Location(latitude, longitude, height)

    def get_location(self):
        return self.place


class Field:
    """Antennas on stones, and what each of them hears."""

    def __init__(self, **air):
        self.clock = VirtualClock()
        self.air = InProcessAir(self.clock, random.Random(1), **air)
        self.antennas = {}
        self.heard = []

    def put(self, node, x, y=0.0):
        host = SimpleNamespace(
            node_id=node,
            drone=Stone(Location(y, x, 0.0)),
            hear=lambda payload: self.heard.append((node, payload)),
        )
        self.antennas[node] = self.air.antenna(host, random.Random(node))
        self.antennas[node].start_antenna(MESH)

    def send(self, from_, to):
        payload = bytes((from_, from_, 2, to, to)).ljust(32, b"\0")
        return self.antennas[from_].send_message_to(payload)

    def run(self):
        self.clock.run_until(self.clock.now_s + 1.0)
        heard, self.heard = self.heard, []
        return [(node, payload[3]) for node, payload in heard]


def test_links_are_those_of_the_places_after_a_drone_comes_flies_or_is_cut_off():
    rng = random.Random(7)
    field = Field(max_distance_m=9.0)
    air = field.air
    flying, cut, gone = set(), set(), set()
    for node in range(30):
        field.put(node, rng.uniform(0, 30), rng.uniform(0, 30))
    seen_in_flight = 0
    for _ in range(400):
        node, other = rng.sample(range(30), 2)
        what = rng.choice(["take off", "land", "cut", "mend", "stop", "start"])
        if what == "take off" and node not in flying:
            flying.add(node)
            air.flight(node, True)
        elif what == "land" and node in flying:
            flying.discard(node)
            air.flight(node, False)
        elif what in ("cut", "mend"):
            (cut.add if what == "cut" else cut.discard)(frozenset((node, other)))
            air.cut(node, other, what == "cut")
        elif what == "stop":
            gone.add(node)
            field.antennas[node].stop_antenna()
        elif what == "start" and node in gone:
            gone.discard(node)
            field.antennas[node].start_antenna(MESH)
        for moving in flying:
            field.antennas[moving].drone.set_goal(rng.uniform(0, 30), rng.uniform(0, 30), 0.0)
        for one in range(30):
            expected = {
                n
                for n in range(30)
                if n != one
                and not {n, one} & gone
                and frozenset((n, one)) not in cut
                and field.antennas[one].drone.place.distance_m(field.antennas[n].drone.place) < 9
            }
            assert set(air.in_range(one)) == expected, (what, one, flying)
            if one not in gone:
                taken = {n for n in range(30) if n != one and field.send(one, n)}
                assert taken == expected, (what, one, flying)
            seen_in_flight += len(expected) if one in flying else 0
    assert seen_in_flight > 100


def test_a_packet_arrives_after_its_delay():
    field = Field(delay_s=0.25)
    field.put(1, 0.0)
    field.put(2, 5.0)
    assert field.send(1, 2)
    field.clock.run_until(0.2499)
    assert field.heard == []
    field.clock.run_until(0.25)
    assert [node for node, _payload in field.heard] == [2]


def test_packets_that_overtake_each_other_all_arrive_in_the_order_of_their_times():
    clock = VirtualClock()
    arrived = []
    for at_s in (3.0, 1.0, 2.0, 5.0, 4.0):
        clock.call_in_line(at_s, arrived.append, at_s)
    clock.call_at(2.5, arrived.append, 2.5)
    assert clock.next_event_s() == 1.0
    clock.run_until(4.5)
    assert arrived == [1.0, 2.0, 2.5, 3.0, 4.0]
    clock.run_until(10.0)
    assert arrived[5:] == [5.0]
    assert clock.now_s == 10.0


def test_events_of_one_moment_happen_in_the_order_of_their_asking():
    clock = VirtualClock()
    happened = []
    clock.call_in_line(1.0, happened.append, "first")
    clock.call_at(1.0, happened.append, "second")
    clock.call_in_line(1.0, happened.append, "third")
    clock.run_until(1.0)
    assert happened == ["first", "second", "third"]


@pytest.mark.parametrize("silent", [1, 2])
def test_a_node_without_power_neither_sends_nor_hears(silent):
    field = Field()
    field.put(1, 0.0)
    field.put(2, 5.0)
    field.antennas[silent].powered = False
    assert not field.send(1, 2)
    assert field.run() == []


def test_a_sender_knows_which_of_its_packets_were_lost():
    field = Field(loss=0.5)
    field.put(1, 0.0)
    field.put(2, 5.0)
    taken = sum(field.send(1, 2) for _ in range(200))
    assert 60 < taken < 140
    assert len(field.run()) == taken


@pytest.mark.parametrize("step_m", [0.03, 0.5, 5.0])  # of a margin of 1.8 m
def test_links_follow_many_drones_that_move_slowly_or_fast(step_m):
    rng, field = random.Random(5), Field(max_distance_m=9.0)
    places = [[rng.uniform(0, 40), rng.uniform(0, 40), 0.0] for _ in range(40)]
    courses = [(rng.uniform(-step_m, step_m), rng.uniform(-step_m, step_m)) for _ in places]
    for node, (x, y, _z) in enumerate(places):
        field.put(node, x, y)
    changed = 0
    links = {}
    for _ in range(200):
        for node, (place, course) in enumerate(zip(places, courses)):
            place[0], place[1] = ((a + b) % 40 for a, b in zip(place, course))
            field.antennas[node].drone.set_goal(place[1], place[0], 0.0)
        field.air.moved(range(40))
        for node, here in enumerate(places):
            near = {n for n, there in enumerate(places) if math.dist(here, there) < 9.0} - {node}
            assert set(field.air.in_range(node)) == near
            changed += links.get(node) != near
            links[node] = near
    assert changed > 80
