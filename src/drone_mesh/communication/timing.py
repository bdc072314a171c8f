"""The times, rates and deadlines to which a node keeps.

The adjustable times of the protocol, what the medium adds to them, the timers of a node, and limits
per period. Knows no packet.
"""

from __future__ import annotations

import enum
import math
from collections import Counter
from dataclasses import dataclass, replace

from drone_mesh.compiled import mypyc_attr
from drone_mesh.settings import setting, settings_of

HEARTBEAT_ANSWER_S = 0.5  # at most one heartbeat to the gateway within this time
CIRCULATION_S = 0.5  # the same packet from another neighbour within this time circulates
FLIGHT_POSITION_PERIOD_S = 1.0  # how often a flying node requests its position
MIN_REPORT_PERIOD_S = 30.0  # docs/protocol.md, "Node reports"
LANDED_WITHIN_M = 0.1  # docs/repair.md, "Flight"


@mypyc_attr(native_class=False)  # whose fields pydantic reads
@dataclass(frozen=True)
class MeshTiming:
    """Adjustable numbers of one node; the defaults are those of docs/protocol.md."""

    check_period_s: float = setting(
        10.0,
        "seconds between two checks of routes and connection",
        "seconds",
        least=0.1,
        most=3600.0,
    )
    connection_lost_after_s: float = setting(
        0.0,
        "seconds without a gateway before a node starts a repair",
        "seconds",
        least=0.1,
        most=3600.0,
        zero="those of the routing technique: 30, or 10 with beacon",
    )
    send_attempts: int = setting(
        3, "failed transmissions of a packet, in total", "a whole number", least=1, most=20
    )
    report_period_s: float = setting(
        0.0,
        "seconds between two reports of a router to its gateway, for GET /mesh and the web console",
        "seconds",
        least=MIN_REPORT_PERIOD_S,
        most=3600.0,
        zero="no reports",
    )

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a number outside its range."""
        for declared in settings_of(self):
            declared.check(declared.default)

    def lost_after(self, seconds: float) -> MeshTiming:
        """The same; without a gateway for `seconds` is an emergency, unless these set it."""
        lost_after_s = self.connection_lost_after_s or seconds
        return replace(self, connection_lost_after_s=lost_after_s)


FAST_HOP_S = 0.0026  # of an nRF24L01+ at 250 kbit/s; the times of the mesh suit hops up to this


@dataclass(frozen=True)
class Policy:
    """What the mesh does because of how its packets are delivered, whatever a hop takes.

    The defaults are those of immediate delivery, on links that do not disturb each other: a send
    tells at once whether the packet arrived.
    """

    queued: bool = False  # the antenna queues packets, and reports their fate later
    one_loss_counts: bool = True  # a neighbour that does not take one packet is lost
    losses_noticed_late: bool = False  # neighbours lost together may be noticed by several checks
    checks_soon: bool = False  # the loss of a neighbour is soon followed by a check
    asks_in_turn: bool = False  # a router asks one neighbour at a time for a gateway, not all
    searches_from_start: bool = False  # a node presents itself again before its first gateway, too
    answers_prove_relays: bool = False  # a gateway's answer counts for the relays that forward it
    drops_are_certain: bool = True  # an order that a relay says it dropped did not get past it
    search_pause_s: float = 0.0  # between two searches of a node; every node repeats each
    ask_sealed_s: float = 0.3  # how often a drone in flight asks for places, in a mesh with a key
    data_in_trains: bool = False  # users' data over relays, which cannot receive while they send
    data_yields: bool = False  # a node that lost its gateway holds users' data that it repeats
    challenges_all: bool = False  # one broadcast challenges many neighbours that may not exist


IMMEDIATE = Policy()
QUEUED = Policy(
    queued=True,
    one_loss_counts=False,
    losses_noticed_late=True,
    checks_soon=True,
    asks_in_turn=True,
    searches_from_start=True,
    answers_prove_relays=True,
    drops_are_certain=False,
    search_pause_s=0.3,
    ask_sealed_s=1.0,  # takes a handshake, too
    data_in_trains=True,
    data_yields=True,
    challenges_all=True,
)


@dataclass(frozen=True)
class Medium:
    """Properties of a medium. The defaults are those of links that do not disturb each other.

    A node that looks for a gateway searches again after `search_s`, and then after twice as long
    each time (Trickle, RFC 6206), since broadcasts are not acknowledged.

    On a shared channel every packet costs all nodes in range airtime, and one lost packet says
    little. There the antenna queues packets and makes all attempts itself (the mesh adds none), and
    later reports what it could not deliver. The mesh sends fewer packets:

    * MISSING is one broadcast, and the same node is not announced again within `missing_quiet_s`;
    * a node that looks for a gateway is answered by one PRESENT for all, after a random part of
      `answer_spread_s`, unless another node answered first (Trickle, RFC 6206: suppression);
    * a router that asks its neighbours in turn for a gateway waits `answer_s` for each;
    * what is known to work is not probed in each round: a neighbour that was heard within
      `heard_periods` check periods, or longer on a busy channel (IWirelessCommunication.patience).
      Nor what is proved by answers to others (the data-path validation of CTP: Gnawali et al.,
      Collection Tree Protocol, 2009);
    * a place is asked for again after `place_periods` check periods;
    * a gateway counts as lost after `heartbeats` unanswered ones.
    """

    hop_s: float = 0.002  # one packet and its acknowledgement, from the decision to listening again
    policy: Policy = IMMEDIATE
    answer_s: float = HEARTBEAT_ANSWER_S  # how long to wait for the answer to a heartbeat
    answer_per_hop_s: float = 0.0  # additional time for each hop to the gateway
    heartbeats: int = 1
    answer_spread_s: float = 0.0
    search_s: float = 0.25
    missing_quiet_s: float = 0.0
    silence_s: float = 0.0  # a neighbour heard within this time survives one undelivered packet
    heard_periods: float = 0.0
    place_periods: float = 0.0
    data_pause_s: float = 0.005  # between bursts of users' packets
    takes_off_after_s: float = 0.0  # a router tells its neighbours first where it is ordered to
    takes_off_within_s: float = 0.0  # even if one that may need it has not acknowledged that
    report_frame_s: float = 0.0  # between two reports of a drone in flight at 1 hop

    @classmethod
    def for_hop(cls, hop_s: float) -> Medium:
        """A channel shared by packet radios that need `hop_s` for a hop."""
        fast = cls(hop_s)
        return cls(
            hop_s,
            QUEUED,
            answer_s=fast.stretched(1.0),
            answer_per_hop_s=100 * hop_s,
            heartbeats=3,
            answer_spread_s=200 * hop_s,
            search_s=800 * hop_s,
            missing_quiet_s=fast.stretched(5.0),
            silence_s=fast.stretched(3.0),
            heard_periods=1.05,
            place_periods=2.5,
            data_pause_s=4 * hop_s,
            takes_off_after_s=fast.stretched(0.3),
            takes_off_within_s=fast.stretched(2.0),
            report_frame_s=fast.stretched(2.0),
        )

    def stretched(self, seconds: float) -> float:
        """What a time that suits hops of FAST_HOP_S becomes on this medium; never shorter."""
        return seconds * max(1.0, self.hop_s / FAST_HOP_S)


UNDISTURBED = Medium()


@dataclass(frozen=True)
class ChannelUse:
    """One node's use of a shared channel; all zero on other media."""

    airtime: float = 0.0  # share of the last second or more that the node's frames took
    tries: float = 0.0  # per packet with acknowledgement, since the start
    waiting: int = 0  # packets in its queue now
    given_up: int = 0  # packets given up after all tries, since the start


class Due(enum.IntEnum):
    """The kinds of work that a component schedules, in the order in which it does what is due."""

    ANSWER = 0  # the latest moment for the gateway's answer to a heartbeat
    INTRODUCE = 1  # after the antenna came back
    ROUTING = 2  # the routing technique's timer
    ASK_POSITION = 3  # in flight
    ORDER_REPLIES = 4  # a drone's outstanding replies to orders
    DATA = 5  # users' messages
    NODE_REPORT = 6  # the next report to the gateway
    OWN_ID = 7  # the end of the time in which it gives way to another radio with its id
    CHECK = 8  # the periodic check of routes and connection
    GOAL = 9  # repeats the announcement of an ordered flight
    TAKE_OFF = 10  # the ordered flight that was announced
    REPAIR = 11  # the repair's timer
    ORDERS = 12  # a gateway's open orders


class Deadlines:
    """The time of the component's latest call, and one deadline per kind of work.

    Read for each packet and rarely changed, so the earliest deadline is cached.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.at_s = [math.inf] * len(Due)  # by Due, infinity: never; changes only here
        self.next_s = math.inf  # the earliest of all

    def set(self, due: int, at_s: float) -> None:
        """Schedule `due`, one of Due, at `at_s`; infinity cancels it."""
        before_s = self.at_s[due]
        self.at_s[due] = at_s
        if at_s <= self.next_s:
            self.next_s = at_s
        elif before_s <= self.next_s:
            self.next_s = min(self.at_s)

    def clear(self) -> None:
        self.at_s[:] = [math.inf] * len(Due)
        self.next_s = math.inf


LIMIT_PERIOD_S = 10.0  # one check period
STRANGERS = 16  # losses per period of nodes that never took a packet
REPEATS = 64  # announcements of one missing node per period; lossy links need many


class RateLimit:
    """At most `times` per period and node. At most one entry per node id."""

    def __init__(self, times: int, period_s: float = LIMIT_PERIOD_S) -> None:
        self._times = times
        self._period_s = period_s
        self._counted: dict[int, tuple[float, int]] = {}  # by node: start of the period, how often

    def count(self, node: int, now_s: float) -> bool:
        """Count one more; returns whether it is within the limit."""
        since_s, times = self._counted.get(node, (now_s, 0))
        if now_s - since_s >= self._period_s:
            since_s, times = now_s, 0
        self._counted[node] = (since_s, times + 1)
        return times < self._times

    def reached(self, node: int, now_s: float) -> bool:
        """Whether one more would exceed the limit."""
        since_s, times = self._counted.get(node, (now_s, 0))
        return times >= self._times and now_s - since_s < self._period_s


class Strangers:
    """Nodes that never acknowledged a packet. If too many of them are lost, they get no packets."""

    def __init__(self) -> None:
        self.known: set[int] = set()  # acknowledged a packet; the owner adds to it
        self._losses = RateLimit(STRANGERS)

    def gave_up(self, node: int, now_s: float) -> None:
        """A packet for `node` was given up."""
        if node not in self.known:
            self._losses.count(0, now_s)

    def ignores(self, node: int, now_s: float) -> bool:
        """Whether no packet is to be spent on it now."""
        return node not in self.known and self._losses.reached(0, now_s)


class Throttle:
    """Decides which lines are logged. One thread at a time; the caller passes the time."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._logged_s: dict[str, float] = {}
        self.counts: Counter[str] = Counter()

    def count(self, reason: str, now_s: float) -> bool:
        """Count `reason`; True if it is to be logged now.

        A clock that went back, as at the start of another simulation, does not silence a reason.
        """
        self.counts[reason] += 1
        logged_s = self._logged_s.get(reason)
        if logged_s is not None and 0 <= now_s - logged_s < self._period_s:
            return False
        self._logged_s[reason] = now_s
        return True
