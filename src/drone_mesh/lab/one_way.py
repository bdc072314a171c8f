"""Links that work one way only: radios that are mute or deaf, or send with less power."""

from __future__ import annotations

from typing import Hashable

from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.inprocess import Network
from drone_mesh.lab.scenario import Scenario
from drone_mesh.lab.streams import Streams
from drone_mesh.nrf24.emulator.links import Hop

_FREE_SPACE, _OUTDOORS = 2.0, 2.7  # exponents of the path loss, as in IdealDisc and LogDistance


class OneWay:
    """Who hears whom in one run, apart from what distance and obstacles allow."""

    def __init__(self, scenario: Scenario, streams: Streams) -> None:
        """Draw how much shorter each node's range is."""
        self.mute: set[int] = set()  # these send nothing
        self.deaf: set[int] = set()  # and these receive nothing
        self._reach_m: dict[int, float] = {}
        most_db, rng = scenario.radio.asymmetry_db, streams.of("asymmetry")
        faded = scenario.obstacles.fading != "none"
        exponent = _OUTDOORS if scenario.radio.links == "distance" or faded else _FREE_SPACE
        for node in range(MAX_DRONES if most_db else 0):
            less_db = rng.uniform(0.0, most_db)
            self._reach_m[node] = scenario.range_m * 10 ** (-less_db / (10 * exponent))
        acted = {fault.action for fault in scenario.faults} & {"mute", "deaf"}
        incidents = () if scenario.sequence is None else scenario.sequence.incidents
        self.occurs = bool(most_db or acted or {"goes_mute", "goes_deaf"} & set(incidents))
        self._network: Network | None = None

    def put(self, network: Network) -> None:
        """Tell the air who hears whom, if any link may work one way only."""
        self._network = network
        if self.occurs:
            network.air.hears = self.hears

    def hears(self, sender: int, receiver: int) -> bool:
        """Whether the receiver hears the sender, if they are in range of each other."""
        if sender in self.mute or receiver in self.deaf:
            return False
        reach_m, network = self._reach_m.get(sender), self._network
        if reach_m is None or network is None or not {sender, receiver} <= network.nodes.keys():
            return True
        return network.location(sender).distance_m(network.location(receiver)) < reach_m

    def loses(self, hop: Hop) -> bool:
        """Whether a frame on a shared channel is lost for that."""
        return not self.hears(_node(hop.sender), _node(hop.receiver))


def _node(name: Hashable) -> int:
    """The id of a radio; an emulated chip has a name that ends in it."""
    return int(str(name).rpartition(" ")[2])
