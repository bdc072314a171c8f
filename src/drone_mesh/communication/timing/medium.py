"""The properties of an antenna's medium, to which the mesh adapts its pace."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.communication.timing.mesh_timing import HEARTBEAT_ANSWER_S

FAST_HOP_S = 0.0026  # of an nRF24L01+ at 250 kbit/s; the times of the mesh suit hops up to this


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
    * a router asks one neighbour at a time for its gateway, for `answer_s`;
    * what is known to work is not probed in each round: a neighbour that was heard within
      `heard_periods` check periods, or longer on a busy channel (IWirelessCommunication.patience).
      A gateway's answer that a router forwards proves its own connection, too (the data-path
      validation of CTP: Gnawali et al., Collection Tree Protocol, 2009);
    * a place is asked for again after `place_periods` check periods;
    * a gateway counts as lost after `heartbeats` unanswered ones.
    """

    hop_s: float = 0.002  # one packet and its acknowledgement, from the decision to listening again
    shared: bool = False
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

    @classmethod
    def for_hop(cls, hop_s: float) -> Medium:
        """A channel shared by packet radios that need `hop_s` for a hop."""
        fast = cls(hop_s)
        return cls(
            hop_s,
            shared=True,
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
