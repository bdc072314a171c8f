"""Node 9 gives a packet to a neighbour, keeps it, returns it or drops it, and searches."""

from __future__ import annotations

import pytest
from rig import packet

from drone_mesh.communication.beacon.courier import DROP, HOLD, Transit
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon, Below
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.verdicts import SUSPECTED_S, Searches, Verdicts
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

OWN, FROM_5_THROUGH_1 = "09 09 00 00 32", "05 01 00 09 32"  # for node 50
UP = "05 01 00 09 00"


class Node:
    def __init__(self):
        self.deadlines, self.searches = Deadlines(), []
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, one_loss_counts=True, clock=self.deadlines
        )
        searches = Searches(9, self.routes, lambda _k, _c, body: self.searches.append(body), 1e-5)
        self.verdicts = Verdicts(self.routes, searches, self.deadlines)

    def hear(self, neighbour, now_s=0.0, below=(), hops=3, parent=8, number=5):
        self.deadlines.now_s, listed = now_s, Below(0, below)
        beacon = Beacon(0, number, hops, parent, NO_ANCESTORS, 1.0, below=listed)
        self.routes.heard(neighbour, beacon)

    def verdict(self, transit, now_s=0.0):
        self.deadlines.now_s = now_s
        return self.verdicts.verdict_on(transit)


@pytest.fixture
def node():
    return Node()


def transit(text):
    return Transit(packet(text), came_from=255 if text == OWN else 1, seen_s=0.0)


@pytest.mark.parametrize(
    ("text", "searches"),
    [(OWN, [b"\x32\1\0\x0c"]), (FROM_5_THROUGH_1, [b"\x32\1\0\2"]), (UP, [])],
)
def test_a_packet_without_a_way_waits_and_a_drone_is_searched_for(node, text, searches):
    node.routes.gateway = 0
    assert node.verdict(transit(text)) == HOLD
    assert node.searches == searches
    assert node.deadlines.at_s[Due.ROUTING] == 0.15
    node.deadlines.set(Due.ROUTING, 0.1)
    node.verdict(transit(text))
    assert node.deadlines.at_s[Due.ROUTING] == 0.1


def test_it_waits_for_two_and_a_half_seconds_and_a_bid_does_not(node):
    assert node.verdict(transit(OWN), 2.4) == HOLD
    assert node.verdict(transit(OWN), 2.5) == DROP
    assert node.verdict(transit("05 01 07 09 32")) == DROP


def test_a_relay_that_finds_nobody_returns_a_packet_once_and_to_a_neighbour_only(node):
    of_5 = transit(FROM_5_THROUGH_1)
    assert node.verdict(of_5, 0.6) == HOLD
    node.hear(1)
    assert node.verdict(of_5, 0.5) == HOLD
    assert node.verdict(of_5, 0.6) == 1
    of_5.failed_s[1] = 0.6
    assert node.verdict(of_5, 0.7) == HOLD
    of_5.sent_s, of_5.failed_s = {1: 0.6}, {}
    assert node.verdict(of_5, 0.7) == HOLD


def test_a_packet_does_not_go_back_to_where_it_came_from(node):
    node.hear(1, below=(50,))
    assert node.verdict(transit(FROM_5_THROUGH_1)) == HOLD


def test_a_neighbour_that_has_the_packet_gets_it_again_if_it_lists_the_addressee_again(node):
    own = transit(OWN)
    node.hear(2, below=(50,))
    own.sent_s[2] = 0.0
    assert node.verdict(own) == HOLD
    node.hear(2, 0.5, below=(50,))
    assert node.verdict(own, 0.5) == 2


def test_a_neighbour_that_did_not_take_the_packet_gets_it_again_after_a_sign_of_life(node):
    own = transit(OWN)
    node.hear(2, below=(50,))
    own.failed_s[2] = 0.1
    assert node.verdict(own, 0.1) == HOLD
    node.routes.clock.now_s = 0.2
    node.routes.alive(2)
    assert node.verdict(own, 0.2) == 2


def shared(node, text):
    """Neighbour 1, from which a packet came, and 2, which did not take it after 0.5 s."""
    node.routes.one_loss_counts = False
    node.hear(1, 0.3)
    node.hear(2, 0.3, below=(50,))
    of_5 = transit(text)
    of_5.failed_s[2] = 0.5
    return of_5


USERS = "05 01 80 09 32"


def test_on_a_shared_channel_it_gets_a_users_message_once_more_after_a_burst_and_then_it_goes_back(
    node,
):
    of_5 = shared(node, USERS)
    assert node.verdict(of_5, 0.8) == HOLD
    assert node.verdict(of_5, 0.95) == 2
    of_5.failed_s[2] = 1.0
    assert node.verdict(of_5, 1.5) == 1


def test_what_its_creator_repeats_goes_back_at_once(node):
    assert node.verdict(shared(node, FROM_5_THROUGH_1), 0.95) == 1


def test_on_a_shared_channel_who_counts_as_gone_does_not_get_it_once_more(node):
    of_5 = shared(node, USERS)
    node.routes.neighbours[2].failed_s = 0.5
    assert node.verdict(of_5, 0.95) == 1


@pytest.mark.parametrize(
    ("text", "sent_to", "to"), [(OWN, (3, 4), 5), (OWN, (3, 4, 5), HOLD), (UP, (3, 4, 5), 6)]
)
def test_three_neighbours_get_a_packet_down_and_any_number_one_up(node, text, sent_to, to):
    for age, neighbour in enumerate((3, 4, 5, 6)):
        node.hear(neighbour, 0.4 - 0.1 * age, below=(50,), hops=1 + age)
    node.routes.choose()
    sent = transit(text)
    sent.sent_s = dict.fromkeys(sent_to, 0.5)
    assert node.verdict(sent, 0.5) == to


GATEWAY, LIAR, RELAY, DRONE = 0, 1, 2, 9
DRONES = (DRONE, 10, 11, 12)
POLL, LAST_OF_TRAIN = b"\1\0\5\0\0\0", b"\1\0\0\0\0\0"  # session, nonce, message, checksum


class Sender:
    """A gateway with two neighbours that say to hear the drone; the liar said it last."""

    def __init__(self):
        self.deadlines = Deadlines()
        self.routes = BeaconRoutes(
            GATEWAY, True, 10.0, lambda _node: None, one_loss_counts=True, clock=self.deadlines
        )
        searches = Searches(GATEWAY, self.routes, lambda *_packet: None, 0.002)
        self.verdicts = Verdicts(self.routes, searches, self.deadlines)
        self.claim()

    def claim(self):
        for node, ago_s in ((RELAY, 0.1), (LIAR, 0.0)):
            self.routes.clock.now_s = self.deadlines.now_s - ago_s
            near = Beacon(GATEWAY, 1, 1, GATEWAY, NO_ANCESTORS, 2.0, near=DRONES)
            self.routes.heard(node, near)

    def next_hop(
        self, after_s=0.0, kind=MessageType.MOVE_TO_LOCATION, came_from=NO_ROUTE, to=DRONE, body=b""
    ):
        self.deadlines.now_s += after_s
        self.claim()
        packet = messages.packet(kind, GATEWAY, GATEWAY, NO_ROUTE, to, body)
        return self.verdicts.verdict_on(Transit(packet, came_from, self.deadlines.now_s))


@pytest.fixture
def sender():
    return Sender()


@pytest.mark.parametrize("came_from", [NO_ROUTE, 7], ids=["made here", "of another node"])
def test_an_order_without_an_answer_goes_another_way_the_next_time(sender, came_from):
    tries = [sender.next_hop(after_s=2.0, came_from=came_from) for _ in range(4)]
    assert tries == [LIAR, RELAY, LIAR, RELAY]


def test_a_drone_that_was_heard_since_its_last_order_is_ordered_the_same_way(sender):
    assert sender.next_hop() == LIAR
    sender.routes.clock.now_s += 1.0
    sender.routes.led_to(DRONE, RELAY)
    assert sender.next_hop(after_s=5.0) == LIAR


def test_nobody_is_suspected_for_longer_than_the_order_is_repeated(sender):
    assert sender.next_hop() == LIAR
    assert sender.next_hop(after_s=SUSPECTED_S + 1.0) == LIAR


def test_packets_that_are_no_orders_go_the_best_way(sender):
    assert [sender.next_hop(2.0, MessageType.REQUESTLOCATION) for _ in range(2)] == [LIAR, LIAR]


def test_a_poll_without_an_answer_goes_another_way_too_but_not_one_that_wants_none(sender):
    assert [sender.next_hop(2.0, 193, body=POLL) for _ in range(2)] == [LIAR, RELAY]
    sender = Sender()
    assert [sender.next_hop(2.0, 193, body=LAST_OF_TRAIN) for _ in range(2)] == [LIAR, LIAR]


def unanswered(sender, drones):
    for drone in drones:
        assert sender.next_hop(to=drone) == LIAR
        assert sender.next_hop(after_s=2.0, to=drone) == RELAY


def test_a_neighbour_through_which_three_nodes_gave_no_answer_takes_no_packet_of_any_kind(sender):
    unanswered(sender, DRONES[:2])
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == LIAR
    unanswered(sender, DRONES[2:3])
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == RELAY
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=LIAR) == LIAR


def test_until_a_packet_of_another_node_comes_through_it(sender):
    unanswered(sender, DRONES[:3])
    sender.routes.led_to(12, LIAR)
    sender.deadlines.now_s += 5.0  # that it came from there is no hint any more
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == LIAR


def test_it_is_used_where_there_is_no_other_way(sender):
    unanswered(sender, DRONES[:3])
    del sender.routes.neighbours[RELAY]
    ways = list(sender.routes.next_hops(12, NO_ROUTE))
    assert [way.neighbour for way in ways] == [LIAR]


class Router(Node):
    """Its parent is 2; 3 and 4 are a hop farther from the gateway, 0."""

    def __init__(self):
        super().__init__()
        self.now_s = 0.0

    def sends_to(self, kind, after_s=2.0, body=POLL):
        self.now_s += after_s
        for neighbour, hops in ((2, 1), (3, 2), (4, 2)):
            self.hear(neighbour, self.now_s, hops=hops, number=int(self.now_s))
        self.routes.choose()
        sent = messages.packet(kind, 9, 9, NO_ROUTE, GATEWAY, body)
        return self.verdict(Transit(sent, NO_ROUTE, self.now_s), self.now_s)

    def hears_gateway(self, through):
        self.verdicts.hears(GATEWAY, through)
        self.routes.led_to(GATEWAY, through)


DATA, QUESTION = 128, 193


def test_once_the_gateway_has_answered_another_way_all_packets_for_it_go_that_way():
    """Data went to the parent again, and only the question about it another way: for ever."""
    router = Router()
    others = [router.sends_to(QUESTION) for _ in range(3)]
    assert sorted(others) == [2, 3, 4]
    for kind in (DATA, MessageType.REQUESTLOCATION, QUESTION, DATA):
        router.hears_gateway(others[2])
        assert router.sends_to(kind, after_s=0.1) == others[2]
    assert router.sends_to(DATA, after_s=SUSPECTED_S) == 2


def test_while_the_answer_may_be_on_its_way_the_parent_takes_all_other_packets():
    """On a busy channel half of the packets would otherwise take a longer way."""
    router = Router()
    router.hears_gateway(2)
    assert [router.sends_to(kind) for kind in (QUESTION, DATA, DATA)] == [2, 2, 2]
    router.sends_to(QUESTION)
    assert router.sends_to(DATA) == 2


def test_an_answer_that_comes_another_way_back_is_one_to_the_last_question():
    router = Router()
    assert router.sends_to(QUESTION) == 2
    router.hears_gateway(4)
    assert router.sends_to(QUESTION) == 2
    before, last = router.sends_to(QUESTION), router.sends_to(QUESTION)
    router.hears_gateway(5)
    assert {before, last} == {3, 4}
    assert router.sends_to(DATA, after_s=0.1) == last


def test_what_the_gateway_took_itself_no_relay_swallows():
    router = Router()
    router.hear(GATEWAY, hops=0, parent=NO_ROUTE, number=0)
    assert [router.sends_to(QUESTION, after_s=0.1) for _ in range(3)] == [GATEWAY] * 3


HOP_S = 0.0025
FOR_21 = b"\x15\x07\x00\x02"  # node 21, number 7, two hops left


@pytest.fixture
def routes():
    return BeaconRoutes(1, False, 9.0, lambda node: None, one_loss_counts=False, clock=Deadlines())


@pytest.fixture
def sent():
    return []


@pytest.fixture
def searches(routes, sent):
    return Searches(1, routes, lambda kind, creator, body: sent.append((creator, body)), HOP_S)


def test_a_node_searches_for_one_after_the_other(routes, searches, sent):
    searches.search(21, 2)
    searches.search(22, 2)
    assert sent == [(1, b"\x15\x01\x00\x02")]

    routes.clock.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x02\x00\x02")]


def test_a_node_repeats_the_search_of_another_and_waits_before_its_own(routes, searches, sent):
    assert not searches.heard(3, 3, FOR_21)
    searches.search(22, 2)
    assert sent == [(3, b"\x15\x07\x00\x01")]

    routes.clock.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x01\x00\x02")]


def test_on_a_fast_medium_the_same_node_is_searched_again_after_six_tenths_of_a_second(
    routes, sent
):
    searches = Searches(1, routes, lambda *_: sent.append(routes.now_s), 1e-5)
    for step in range(14):
        routes.clock.now_s = step / 8
        searches.search(21, 2)
    assert sent == [0.0, 0.625, 1.25]


def test_after_five_searches_in_vain_it_pauses_for_ten_seconds(routes, searches, sent):
    searched_s = []
    for second in range(40):
        routes.clock.now_s = 2.0 * second
        searches.search(21, 2)
        if len(sent) > len(searched_s):
            searched_s.append(routes.now_s)
    assert searched_s[:7] == [0.0, 2.0, 4.0, 6.0, 8.0, 18.0, 20.0]


@pytest.mark.parametrize(("after_s", "repeated"), [(4.0, 1), (6.0, 2)])
def test_a_search_that_comes_again_is_repeated_once_within_five_seconds(
    routes, searches, sent, after_s, repeated
):
    searches.heard(3, 3, FOR_21)
    routes.clock.now_s = after_s
    searches.heard(3, 4, FOR_21)
    assert len(sent) == repeated


def test_searches_that_found_the_node_do_not_count(routes, searches, sent):
    for second in range(0, 30, 3):
        routes.clock.now_s = float(second)
        searches.search(21, 2)
        searches.found(21)
    assert len(sent) == 10


@pytest.mark.parametrize(("hops_left", "repeated"), [(255, 11), (12, 11), (1, 0)])
def test_a_search_is_repeated_at_most_eleven_times_more(searches, sent, hops_left, repeated):
    searches.heard(3, 3, bytes((21, 7, 0, hops_left)))
    assert sent == [(3, bytes((21, 7, 0, repeated)))]
