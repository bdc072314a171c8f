"""Drones whose batteries run low are relieved, by whom and when."""

from __future__ import annotations

import json

import pytest

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.formations.departures import FlightRules
from drone_mesh.formations.relief import Relief, ReliefRules
from drone_mesh.formations.relief_policies import POLICIES, ReliefView, relief_policy
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.lab.scenario import Endurance
from drone_mesh.state.model import MeshStatus, NodeStatus

POST, HOME, OTHER = Location(6.0, 0.0, 4.0), Location(0.0, 4.0, 0.0), Location(0.0, 8.0, 0.0)


def view(left_s, ready=(), spares=None, interval_s=100.0, places=None, blocked=()):
    return ReliefView(
        left_s=left_s,
        ready=ready,
        spares=ready if spares is None else spares,
        interval_s=interval_s,
        places=places or {},
        gateways=[0],
        range_m=9.0,
        can_fly=lambda new, old: (new, old) not in blocked,
    )


@pytest.mark.parametrize(
    ("name", "seen", "chosen"),
    [
        ("spare_first", view({1: 250.0, 2: 350.0, 3: 450.0}, [7]), None),
        ("spare_first", view({1: 250.0, 2: 299.0}, [7]), (1, 7)),  # two and one more in 299 s
        ("spare_first", view({1: 50.0}, [7, 8], blocked=[(7, 1)]), (1, 8)),
        ("spare_first", view({1: 50.0, 2: 60.0}, [7], blocked=[(7, 1)]), (2, 7)),
        ("spare_first", view({1: 50.0}, [], spares=[7]), None),
        ("named_backup", view({1: 5.0, 2: 6.0}, [7, 8]), None),
        ("named_backup", view({2: 0.0, 1: 5.0}, [7, 8]), (2, 8)),  # 7 is the backup of 1
        ("named_backup", view({2: 0.0, 1: 5.0}, [7], spares=[7, 8]), None),
    ],
)
def test_each_policy_chooses(name, seen, chosen):
    assert relief_policy(name).choose(seen) == chosen


def test_the_rotation_sends_the_fullest_neighbour_that_the_mesh_does_not_need():
    places = {0: (0.0, 0.0), 1: (8.0, 0.0), 2: (16.0, 0.0), 3: (8.0, 4.0), 4: (8.0, -4.0)}
    left_s = {2: 0.0, 3: 100.0, 4: 200.0, 1: 900.0}
    assert relief_policy("rotate").choose(view(left_s, places=places)) == (2, 1)
    del left_s[1]
    assert relief_policy("rotate").choose(view(left_s, places=places)) == (2, 4)
    del places[3], places[4]  # now 2 is reached over 1 alone
    left_s = {2: 0.0, 1: 900.0}
    assert relief_policy("rotate").choose(view(left_s, places=places)) is None


def test_backups_are_named_when_the_first_is_needed_and_not_while_all_stand_on_the_ground():
    policy = relief_policy("named_backup")
    assert policy.choose(view({}, [1, 2, 7])) is None
    assert policy.choose(view({1: 0.0, 2: 5.0}, [7])) == (1, 7)
    assert policy.choose(view({3: 0.0}, [7])) == (3, 7)  # it was sent up later


def test_the_policies_have_the_same_names_everywhere():
    for name in POLICIES:
        assert Endurance(relief=name).relief == FactoryConfiguration(seed=1, relief=name).relief
    with pytest.raises(ConfigurationError, match="unknown relief c3r: use none, spare_first"):
        relief_policy("c3r")


class Mesh:
    """One drone on a post and one spare at home; the mesh is told to Relief second by second."""

    def __init__(self):
        self.now_s, self.orders = 0.0, StandingOrders()
        self.holder = NodeStatus(1, connected=True, position=POST.to_vector(), battery=100.0)
        self.spare = NodeStatus(2, connected=True, position=HOME.to_vector(), battery=100.0)
        self.relief = Relief(relief_policy("spare_first"), ReliefRules(), {1: OTHER, 2: HOME})
        self.others, self.rules = [], FlightRules()

    def hover(self, node, percent):
        """Until its battery has so much left."""
        self.now_s += 12.0 * (node.battery - percent)
        node.battery = percent

    def sent(self, seconds=1):
        """The orders of so many seconds."""
        sent = {}
        for _ in range(seconds):
            gateway = NodeStatus(0, Role.GATEWAY, connected=True, position=(0.0, 0.0, 4.0))
            mesh = MeshStatus(self.now_s, [gateway, self.holder, self.spare, *self.others])
            self.relief.update(mesh, self.orders, self.rules)
            sent.update(dict(self.orders.update(mesh)))
            self.now_s += 1.0
        return sent

    def posts(self):
        """Their places, by holder."""
        return {post["holder"]: post["places"] for post in self.relief.saved()["posts"]}


@pytest.fixture
def mesh():
    return Mesh()


def test_the_old_drone_leaves_when_the_new_one_beside_it_has_been_connected_for_a_while(mesh):
    assert mesh.sent() == {}
    mesh.hover(mesh.holder, 26.0)  # 20 and 2 percent stay, 1 percent is 12 s
    ((drone, place),) = mesh.sent().items()
    assert drone == 2
    assert 1.4 < place.distance_m(POST) < 1.6
    mesh.spare.position, mesh.spare.connected = place.to_vector(), False
    assert mesh.sent(30) == {}
    mesh.spare.connected = True
    assert mesh.sent(5) == {}
    assert mesh.sent() == {1: OTHER}
    assert mesh.relief.reliefs == 1
    mesh.holder.position, mesh.holder.battery = OTHER.to_vector(), 100.0
    mesh.hover(mesh.spare, 26.0)  # the next one comes to the first place of the post again
    assert mesh.sent(2) == {1: POST}


def test_a_full_spare_stays_in_reserve_while_all_can_be_relieved_in_time(mesh):
    assert mesh.sent() == {}
    mesh.hover(mesh.holder, 46.0)
    assert mesh.sent() == {}
    mesh.hover(mesh.holder, 44.0)  # two reliefs of 111 s each, with the swap
    assert mesh.sent().keys() == {2}


def test_a_drone_that_nobody_can_relieve_goes_home_in_time_and_its_post_is_filled_later(mesh):
    mesh.spare.battery = 50.0
    assert mesh.sent() == {}
    mesh.hover(mesh.holder, 22.0)
    assert mesh.sent() == {1: OTHER}
    mesh.holder.position = OTHER.to_vector()
    mesh.spare.battery = 100.0
    ((drone, place),) = mesh.sent().items()
    assert drone == 2
    assert place.distance_m(POST) < 1.6


def test_a_spare_that_does_not_come_is_called_back_and_another_relief_begins(mesh):
    mesh.sent()
    mesh.hover(mesh.holder, 30.0)
    assert list(mesh.sent()) == [2]
    mesh.spare.position = (0.0, 2.0, 4.0)  # it hangs there
    assert mesh.sent(130)[2] == HOME
    (first,) = [p for p in mesh.orders.all_progress() if p.name == "drone 2 relieves drone 1"][:1]
    assert first.is_over  # the page shows it until then


@pytest.mark.parametrize("back_when", ["another one is on its way", "another one holds its post"])
def test_a_drone_that_was_silent_at_its_post_goes_home_when_another_one_has_come(mesh, back_when):
    mesh.sent()
    mesh.holder.on = False
    ((drone, place),) = mesh.sent().items()
    assert drone == 2
    if back_when == "another one is on its way":
        mesh.holder.on = True
        assert mesh.sent(5) == {2: place}
    mesh.spare.position = place.to_vector()
    if back_when == "another one holds its post":
        assert mesh.sent(10) == {}
        mesh.holder.on = True
    assert mesh.sent(10) == {1: OTHER}


def test_a_drone_that_was_silent_has_its_post_again_if_nobody_came(mesh):
    mesh.spare.battery = 50.0
    mesh.sent()
    mesh.holder.on = False
    mesh.sent(30)
    mesh.holder.on, mesh.spare.battery = True, 100.0
    assert mesh.sent(30) == {}


def test_where_a_drone_is_ordered_is_its_post_from_then_on(mesh):
    mesh.sent()
    mesh.holder.position = (-6.0, 0.0, 4.0)
    mesh.sent()
    mesh.hover(mesh.holder, 26.0)
    ((_drone, place),) = mesh.sent().items()
    assert place.distance_m(Location(0.0, -6.0, 4.0)) < 1.6


def test_a_drone_whose_home_is_unknown_holds_no_post_of_its_own_when_it_is_relieved(mesh):
    mesh.relief = Relief(relief_policy("spare_first"), homes={2: HOME})  # as after a restart
    mesh.sent()
    mesh.hover(mesh.holder, 26.0)
    ((_drone, place),) = mesh.sent().items()
    mesh.spare.position = place.to_vector()
    assert mesh.sent(7) == {}
    assert mesh.relief.reliefs == 1
    mesh.holder.position, mesh.holder.battery = OTHER.to_vector(), 20.0  # it came down by itself
    mesh.sent()
    mesh.holder.battery = 100.0
    assert mesh.sent(5) == {}  # nobody fills a post that is held


AWAY = Location(0.0, -9.0, 4.0)


def relief_on_its_way():
    """The spare flies to the place beside the post; returns the mesh and that place."""
    mesh = Mesh()
    mesh.sent()
    mesh.hover(mesh.holder, 26.0)
    ((drone, place),) = mesh.sent().items()
    assert drone == 2
    mesh.spare.position, mesh.spare.path = (1.0, 4.0, 4.0), place.to_vector()
    mesh.sent()
    return mesh, place


def fly(mesh, node, place):
    """It flies there, and needs no time for that."""
    node.path = place.to_vector()
    sent = mesh.sent()
    node.position, node.path = place.to_vector(), ()
    return {**sent, **mesh.sent()}


def test_a_restart_amid_a_relief_makes_no_second_post():
    mesh, place = relief_on_its_way()
    left = json.loads(json.dumps([mesh.orders.saved(), mesh.relief.saved()]))
    mesh.orders, mesh.relief = StandingOrders(), Relief(relief_policy("spare_first"))
    mesh.orders.restore(left[0])
    mesh.relief.restore(left[1])
    assert fly(mesh, mesh.spare, place) == {}
    assert mesh.sent(6) == {1: OTHER}
    mesh.holder.position, mesh.holder.battery = OTHER.to_vector(), 100.0
    assert mesh.sent(5) == {}
    assert list(mesh.posts()) == [2]


@pytest.mark.parametrize("before", [True, False])
def test_a_coming_drone_that_a_user_sends_elsewhere_is_not_called_home(before):
    """Before it has arrived, or when it hovers there."""
    mesh, place = relief_on_its_way()
    if not before:
        assert fly(mesh, mesh.spare, place) == {}
        mesh.orders.forget_complete()
    mesh.orders.ordered(2, AWAY, mesh.now_s)
    assert 2 not in fly(mesh, mesh.spare, AWAY)
    assert 2 not in mesh.sent(120)
    assert mesh.relief.reliefs == 0


def test_a_drone_that_a_user_sends_elsewhere_takes_its_post_along_and_its_relief_goes_home():
    mesh, place = relief_on_its_way()
    mesh.orders.ordered(1, AWAY, mesh.now_s)
    fly(mesh, mesh.spare, place)
    sent = fly(mesh, mesh.holder, AWAY)
    assert (sent.get(1), sent[2]) == (None, HOME)
    posts = mesh.posts()
    assert posts[1][0] == AWAY
    assert 2 not in posts


def test_a_drone_that_fails_while_its_relief_comes_is_left_alone_and_its_post_is_held():
    mesh, place = relief_on_its_way()
    mesh.holder.position, mesh.holder.crashed = (0.0, 6.0, 0.0), True
    assert fly(mesh, mesh.spare, place) == {}
    assert mesh.sent(10) == {}
    assert list(mesh.posts()) == [2]


def test_a_drone_that_has_another_order_is_no_spare(mesh):
    mesh.sent()
    mesh.orders.ordered(2, AWAY, mesh.now_s)
    mesh.now_s += 1.0
    mesh.holder.battery = 24.0  # it needs one now
    assert 2 not in mesh.sent()


def test_a_drone_that_is_sent_elsewhere_on_its_way_home_holds_a_post_there():
    mesh, place = relief_on_its_way()
    fly(mesh, mesh.spare, place)
    assert mesh.sent(6) == {1: OTHER}
    mesh.holder.battery = 60.0
    mesh.orders.ordered(1, AWAY, mesh.now_s)
    fly(mesh, mesh.holder, AWAY)
    assert mesh.posts().keys() == {1, 2}


def test_a_post_that_is_far_away_is_relieved_too(mesh):
    mesh.holder.position = (0.0, 300.0, 4.0)
    mesh.sent()
    mesh.hover(mesh.holder, 50.0)
    ((_drone, place),) = mesh.sent().items()
    mesh.spare.position, mesh.spare.path = (0.0, 8.0, 4.0), place.to_vector()
    assert mesh.sent(140) == {}  # it flies for 148 s
    mesh.spare.position, mesh.spare.path = place.to_vector(), ()
    assert mesh.sent(7) == {1: OTHER}


def test_nobody_is_sent_to_a_post_whose_drone_flies_elsewhere(mesh):
    mesh.sent()
    mesh.holder.path, mesh.holder.battery = AWAY.to_vector(), 25.0
    mesh.sent(20)
    assert mesh.orders.all_progress() == []


def test_a_battery_that_recovers_by_a_percent_is_used_as_fast_as_before(mesh):
    mesh.spare.battery = 50.0
    mesh.sent()
    for percent in (80.0, 60.0, 50.0):
        mesh.holder.battery = percent
        mesh.now_s += 10.0
        mesh.sent()
    mesh.holder.battery, mesh.spare.battery = 51.0, 100.0  # the usual pace leaves 348 s, this 20
    assert list(mesh.sent()) == [2]


def fence(west):
    """To the west of this no drone may be."""
    zone = Zone("yard", (((-50.0, -50.0), (west, -50.0), (west, 50.0), (-50.0, 50.0)),))
    keep = Fence.of([], [zone])
    return FlightRules(Obstacles((), fence=keep).plan_flight, fence=keep)


@pytest.mark.parametrize("later", [True, False])
def test_the_place_beside_is_within_the_fence_that_there_is_or_comes(mesh, later):
    mesh.holder.position = (6.0, 0.0, 4.0)
    mesh.relief = Relief(relief_policy("spare_first"))  # its home is beyond the fence
    if later:
        mesh.sent()
        (before,) = mesh.posts().values()
        assert before[1].longitude < 5.8
    mesh.rules = fence(5.8)
    mesh.sent()
    (places,) = mesh.posts().values()
    assert places[1].longitude > 5.8


def test_a_neighbour_without_a_known_home_relieves_nobody(mesh):
    mesh.relief = Relief(relief_policy("rotate"), homes={1: OTHER})
    mesh.spare.position = (4.0, 4.0, 4.0)
    mesh.sent()
    mesh.hover(mesh.holder, 23.0)
    assert mesh.sent() == {}


def test_a_place_is_taken_by_a_drone_that_flies_there_and_has_fallen_silent():
    mesh, place = relief_on_its_way()
    mesh.spare.on = False
    mesh.others = [NodeStatus(3, connected=True, position=(0.0, 12.0, 0.0), battery=100.0)]
    mesh.sent(20)
    assert {"3"} & {
        drone for order in mesh.orders.saved()["orders"] for drone in order["goals"]
    } == set()


def test_a_relief_reaches_a_post_between_whole_metres_of_height(mesh):
    mesh.holder.position = (0.0, 6.0, 4.5)
    mesh.sent()
    mesh.hover(mesh.holder, 26.0)
    ((_drone, place),) = mesh.sent().items()
    mesh.spare.position = place.as_ordered()._replace(height=4.03).to_vector()  # orders say 4 m
    assert mesh.sent(7) == {1: OTHER}


@pytest.mark.parametrize(
    ("was_connected", "neighbour_m", "is_replaced"),
    [(True, 5.0, True), (False, 5.0, False), (True, 20.0, False)],
)
def test_a_drone_that_is_on_but_mute_is_replaced_and_goes_home_when_it_is_heard_again(
    mesh, was_connected, neighbour_m, is_replaced
):
    """Not one that nobody could hear, nor one that was never heard there."""
    mesh.holder.position = (0.0, -14.0, 4.0)
    neighbour = (0.0, -14.0 + neighbour_m, 0.0)
    mesh.others = [NodeStatus(3, connected=True, position=neighbour, battery=50.0)]
    mesh.holder.connected = was_connected
    mesh.sent(2)
    mesh.holder.connected = False
    assert mesh.sent(10) == {}
    sent = mesh.sent(2)
    assert list(sent) == [2] * is_replaced
    if is_replaced:
        mesh.spare.position = sent[2].to_vector()
        assert mesh.sent(7) == {}
        mesh.holder.connected = True
        assert mesh.sent(2) == {1: OTHER}


def test_a_neighbour_that_falls_silent_before_it_sets_out_for_another_post_goes_home_later(mesh):
    """Somebody holds the post that it left."""
    mesh.relief = Relief(relief_policy("rotate"), homes={1: OTHER, 2: HOME})
    mesh.others = [NodeStatus(3, connected=True, position=(0.0, 12.0, 0.0), battery=100.0)]
    mesh.spare.position = (4.0, 4.0, 4.0)
    mesh.sent()
    mesh.hover(mesh.holder, 23.0)
    ((filler, place),) = mesh.sent().items()
    assert filler == 3
    mesh.spare.on = mesh.spare.connected = False
    mesh.holder.battery = 90.0
    mesh.others[0].position = place.to_vector()
    mesh.sent(8)
    mesh.spare.on = mesh.spare.connected = True
    assert mesh.sent(2)[2] == HOME


def test_who_flies_for_a_repair_leaves_its_post_behind_and_holds_that_of_the_lost_one(mesh):
    lost = NodeStatus(3, connected=True, position=(6.0, 6.0, 4.0), battery=90.0)
    mesh.others, mesh.spare.battery = [lost], 50.0
    mesh.sent()
    lost.on = lost.connected = False
    mesh.holder.repair_state, mesh.holder.path = 5, (6.0, 7.6, 4.0)
    mesh.sent(2)
    mesh.holder.position, mesh.holder.path = (6.0, 7.6, 4.0), ()
    mesh.holder.repair_state, mesh.spare.battery = 0, 100.0
    ((drone, place),) = mesh.sent(3).items()
    assert (drone, place.distance_m(POST) < 1.6) == (2, True)
    mesh.spare.position = place.to_vector()
    assert mesh.sent(7) == {}
    assert mesh.posts().keys() == {1, 2}


def test_of_two_free_posts_the_one_that_has_been_free_for_longer_is_filled_first(mesh):
    second = NodeStatus(3, connected=True, position=(6.0, 6.0, 4.0), battery=90.0)
    mesh.others, mesh.spare.battery = [second], 50.0
    mesh.sent()
    for node in (second, mesh.holder):
        node.on = node.connected = False
        mesh.sent()
    mesh.spare.battery = 100.0
    ((drone, place),) = mesh.sent().items()
    assert (drone, place.distance_m(Location(6.0, 6.0, 4.0)) < 1.6) == (2, True)


def test_who_ends_a_repair_away_from_all_posts_goes_home_when_they_are_held_and_holds_none(mesh):
    mesh.spare.battery = 50.0
    mesh.sent(2)
    mesh.holder.repair_state, mesh.holder.path = 5, (6.0, 9.0, 4.0)
    mesh.sent(2)
    mesh.holder.position, mesh.holder.path = (6.0, 9.0, 4.0), ()
    mesh.holder.repair_state = 0
    assert mesh.sent(3) == {}
    assert list(mesh.posts()) == [None]
    mesh.spare.battery = 100.0
    ((drone, place),) = mesh.sent(3).items()
    assert (drone, place.distance_m(POST) < 1.6) == (2, True)
    mesh.spare.position = place.to_vector()
    assert mesh.sent(8) == {1: OTHER}
    assert list(mesh.posts()) == [2]


def neighbours(mesh):
    """Holder, spare and a third drone hear each other."""
    third = NodeStatus(3, connected=True, position=(-3.0, 2.0, 4.0), battery=50.0)
    mesh.others = [third]
    for node, heard in ((mesh.holder, (2, 3)), (mesh.spare, (1, 3)), (third, (1, 2))):
        node.neighbours = bytes(heard)
    mesh.sent(2)


def test_a_drone_that_nobody_hears_any_more_is_replaced_although_it_believes_to_be_connected(mesh):
    neighbours(mesh)
    mesh.spare.neighbours, mesh.others[0].neighbours = bytes([3]), bytes([2])
    assert mesh.sent() == {}
    assert list(mesh.sent()) == [2]


def test_a_drone_that_hears_nobody_is_replaced_as_soon(mesh):
    neighbours(mesh)
    mesh.holder.neighbours, mesh.holder.connected = b"", False
    assert mesh.sent() == {}
    assert list(mesh.sent()) == [2]


def test_a_drone_that_looks_for_a_route_among_its_neighbours_is_left_time_for_that(mesh):
    neighbours(mesh)
    mesh.holder.connected = False
    assert mesh.sent(10) == {}
    assert list(mesh.sent(2)) == [2]


def test_a_gap_is_filled_by_the_nearest_drone_that_is_full(mesh):
    near = NodeStatus(3, connected=True, position=(4.0, 6.0, 0.0), battery=100.0)
    mesh.spare.position, mesh.others = (20.0, 4.0, 0.0), [near]
    mesh.relief = Relief(relief_policy("spare_first"))
    mesh.sent()
    mesh.holder.on = False
    assert list(mesh.sent()) == [3]


def test_a_drone_whose_way_home_leads_past_a_drone_at_rest_goes_up_first(mesh):
    mesh.spare.battery = 50.0
    mesh.holder.position = (4.0, 3.0, 4.0)
    mesh.others = [NodeStatus(3, connected=True, position=(7.2, 1.2, 4.0), battery=90.0)]
    mesh.sent()
    mesh.hover(mesh.holder, 22.0)
    ((drone, above),) = mesh.sent().items()
    assert (drone, above[:2]) == (1, (3.0, 4.0))
    assert 5.0 < above.height < 12.0
    mesh.orders.forget_complete()
    for swayed_m in (0.05, 0.1):
        mesh.holder.position = (4.0 + swayed_m, 3.0, 4.0)
        assert mesh.sent(2) == {}
    assert fly(mesh, mesh.holder, above) == {1: OTHER}
    left = json.loads(json.dumps([mesh.orders.saved(), mesh.relief.saved()]))
    mesh.orders, mesh.relief = StandingOrders(), Relief(relief_policy("spare_first"))
    mesh.orders.restore(left[0])
    mesh.relief.restore(left[1])
    assert mesh.sent(30) == {1: OTHER}
    fly(mesh, mesh.holder, OTHER)
    assert mesh.sent(30) == {}
    assert mesh.posts().keys() == {None, 3}


@pytest.mark.parametrize(("x", "goes_up"), [(7.0, True), (8.0, False)])
def test_a_drone_goes_up_only_where_the_gateway_hears_it(mesh, x, goes_up):
    home = Location(1.0, x + 4.0, 0.0)
    mesh.relief = Relief(relief_policy("spare_first"), homes={1: home})
    mesh.holder.position, mesh.spare.connected = (x, 3.9, 4.0), False
    mesh.others = [NodeStatus(3, position=(x + 3.2, 1.6, 4.0), battery=90.0)]
    mesh.sent()
    mesh.hover(mesh.holder, 22.0)
    mesh.sent(3)
    (order,) = mesh.orders.saved()["orders"]
    assert (order["goals"]["1"] != list(home)) is goes_up


def test_who_is_sent_away_takes_its_post_along_although_nobody_hears_it_for_seconds_on_the_way(
    mesh,
):
    mesh.holder.neighbours, mesh.spare.neighbours = bytes([0, 2]), bytes([0, 1])
    mesh.sent(2)
    mesh.holder.neighbours, mesh.spare.neighbours = b"", bytes([0])
    mesh.holder.position, mesh.holder.path = (2.0, 3.0, 2.0), list(OTHER.to_vector())
    assert mesh.sent(5) == {}
    mesh.holder.position, mesh.holder.path = OTHER.to_vector(), []
    assert mesh.sent(5) == {}
    assert mesh.posts() == {}
