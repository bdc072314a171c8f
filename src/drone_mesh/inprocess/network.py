"""A whole mesh in one process, under a virtual clock: for tests, experiments and benchmarks."""

from __future__ import annotations

import functools
import random
from dataclasses import replace
from typing import Callable, Iterable, Mapping

from drone_mesh.air.graph import hops_from
from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.data.outgoing import Ticket
from drone_mesh.communication.data.transport import OnEchoAnswer, ReceivedMessage
from drone_mesh.communication.events.observer import MeshEvent
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.node.assembly import Security, assemble_node
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.communication.node.node_configuration import DEFAULT_ROUTING, NodeConfiguration
from drone_mesh.communication.repair.fiedler import Fiedler
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR, RANGE_M, RepairOptions
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.fleet import (
    DEFAULT_GRIDSIZE,
    DEFAULT_ROUTERS,
    DEFAULT_SPACING_M,
    plan_fleet,
)
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess.airs import create_air
from drone_mesh.inprocess.bounds import SHORTEST_PATH, LinkMap, Oracle, ShortestPath
from drone_mesh.inprocess.drone import Pilots, PositionErrors, PositionReceiver
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.inprocess.node import InProcessNode, NoInternet, event_records, mesh_status
from drone_mesh.inprocess.radio import HOP_DELAY_S
from drone_mesh.mobility import Track
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.emulator.space import RICIAN_K_DB
from drone_mesh.nrf24.settings import DEFAULT_RATE
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.state.observation import describe_fence

ORACLE = "oracle"  # the repair strategy with global knowledge
IDEAL_FIEDLER = "ideal_fiedler"  # the strategy `fiedler` with it
STEP_S = 0.1  # period at which run_until checks its condition


class Network:
    """Drones, their mesh software and an in-process radio. The same seed gives the same run.

    >>> network = Network(seed=1)
    >>> network.add_fleet(gateways=1, routers=16, gridsize=4, spacing=6.0)
    >>> network.run_until(network.all_connected, within_s=15.0)
    True
    """

    def __init__(
        self,
        seed: int = 0,
        timing: MeshTiming | None = None,
        routing: str | Callable[[], ITechnique] = DEFAULT_ROUTING,
        max_distance_m: float = RANGE_M,
        loss: float = 0.0,
        delay_s: float = HOP_DELAY_S,
        jitter_s: float = 0.0,
        radio: str | IInProcessAir = "disc",
        rate: str = DEFAULT_RATE,
        links: LinkModel | None = None,
        fading: str = "none",
        rician_k_db: float = RICIAN_K_DB,
        repair: str | Callable[[], IRepairStrategy] = DEFAULT_REPAIR,
        repair_options: RepairOptions | None = None,
        key: Keys | Callable[[int], Keys | None] | None = None,
        positions: PositionErrors | None = None,
        fence: Fence = Fence(),  # noqa: B008 (frozen)
    ) -> None:
        """`loss`, `delay_s` and `jitter_s` as for InProcessAir; `routing` as in a launch file, or
        "shortest_path", which knows all links: the bound for every other technique; or a class.

        `repair` is the name of a repair strategy, as in a launch file, or "oracle" or
        "ideal_fiedler", which know everything; or a class, or a function that creates one.

        `radio`: "disc", on which packets never meet; "shared", a fast model of nRF24L01+ radios on
        one channel; "chips", the driver on emulated chips; or an air of your own. For "shared" and
        "chips": `rate` (250k, 1M or 2M) and `links`, the space between the radios (default: an
        ideal disc), whose power may fade ("rayleigh" or "rician"; then the default is a power that
        falls with distance). For the disc: `loss`, `delay_s` and `jitter_s`. Raises
        ConfigurationError.

        `key`: the key of the mesh, for every node, or a function that returns the keys of each
        node. None: no seals, of that node or of all. `fence`: what all drones keep.
        """
        self._seed = seed
        self._rng = random.Random(seed)
        self._routing = routing
        self._repair = repair
        self._configuration = NodeConfiguration(
            DEFAULT_ROUTING if routing == SHORTEST_PATH else routing,
            DEFAULT_REPAIR if repair in (ORACLE, IDEAL_FIEDLER) else repair,
            timing or MeshTiming(),
            repair_options or RepairOptions(),
        )
        self._key = key
        self._fence = fence
        self._positions = positions or PositionErrors()
        if isinstance(radio, str):
            medium = (loss, delay_s, jitter_s, rate, links, fading, rician_k_db)
            radio = create_air(radio, self._rng, max_distance_m, *medium)
        self.air = radio
        self.clock = radio.clock
        self._link_map = LinkMap(self.clock, self.links)
        self.nodes: dict[int, InProcessNode] = {}
        self.events: list[MeshEvent] = []
        self.received: dict[int, list[ReceivedMessage]] = {}  # by receiver, in order

    # Construction ----------------------------------------------------------------------------

    def add_gateway(self, node_id: int, x: float, y: float, start_s: float = 0.0) -> None:
        """Add a gateway at (x, y) metres on the ground; it starts at `start_s`."""
        self._add(node_id, x, y, start_s, gateway=True)

    def add_router(
        self, node_id: int, x: float, y: float, start_s: float = 0.0, why_not_fly: str = ""
    ) -> None:
        """Add a router at (x, y) metres on the ground; it starts at `start_s`.

        It flies unless `why_not_fly` gives a reason.
        """
        self._add(node_id, x, y, start_s, gateway=False, why_not_fly=why_not_fly)

    def add_fleet(
        self,
        gateways: int = 1,
        routers: int = DEFAULT_ROUTERS,
        gridsize: int = DEFAULT_GRIDSIZE,
        spacing: float = DEFAULT_SPACING_M,
        apart_s: float = 0.0,
    ) -> None:
        """Add the factory's fleet; each drone starts `apart_s` after the previous one."""
        for node_id, role, x, y in plan_fleet(gateways, routers, gridsize, spacing):
            self._add(node_id, x, y, node_id * apart_s, role is Role.GATEWAY)

    def _add(
        self, node_id: int, x: float, y: float, start_s: float, gateway: bool, why_not_fly: str = ""
    ) -> None:
        if node_id in self.nodes:
            raise ValueError(f"node {node_id} already exists")
        radio_rng = random.Random(f"{self._seed} radio {node_id}")
        place = Location.from_vector((x, y, 0.0))
        node = InProcessNode(self.air, node_id, place, radio_rng, gateway, why_not_fly, self._fence)
        self._install(node, node_id)
        self.nodes[node_id] = node
        self.clock.call_at(start_s, self.air.run, node.start)

    def _install(self, node: InProcessNode, node_id: int) -> None:
        """The mesh software of one node."""
        node.component, node.receiver = assemble_node(
            node_id,
            node.antenna,
            self._engine(node, node_id),
            random.Random(self._rng.random()),
            self._configuration_of(node_id),
            internet=NoInternet() if node.is_gateway else None,
            security=self._security(node_id),
            observer=self.events.append,
        )
        node.component.data.on_received(functools.partial(self._receive, node_id))
        node.deadlines = node.component.deadlines

    def _security(self, node_id: int) -> Security | None:
        keys = self._key(node_id) if callable(self._key) else self._key
        if keys is None:
            return None
        rng = random.Random(f"{self._seed} seal {node_id} {self.now_s()}")  # new at each start
        return Security(keys, self.now_s, rng)

    def _configuration_of(self, node_id: int) -> NodeConfiguration:
        """The configuration of all nodes; only the bounds get one that knows the whole network."""
        configuration = self._configuration
        if self._routing == SHORTEST_PATH:
            path = functools.partial(ShortestPath, self._link_map, node_id)
            configuration = replace(configuration, routing=path)
        if self._repair == ORACLE:
            oracle = functools.partial(Oracle, self._places_of_connected)
            configuration = replace(configuration, repair=oracle)
        elif self._repair == IDEAL_FIEDLER:
            everybody = functools.partial(Fiedler, self._places_of_powered)
            configuration = replace(configuration, repair=everybody)
        return configuration

    def _engine(self, node: InProcessNode, node_id: int) -> IDroneEngine:
        if self._positions.none:
            return node.drone
        rng = random.Random(f"{self._seed} position {node_id}")
        return PositionReceiver(node.drone, self.clock, self._positions, rng)

    @property
    def sealed(self) -> bool:
        """Whether the mesh has a key."""
        return self._key is not None

    def fly(self, tracks: Mapping[int, Track]) -> Pilots:
        """Pilots fly these drones along their tracks from now on; the mesh is not told.

        See drone_mesh.mobility for tracks; `share` and `gateways` of a Mobility say which drones.
        Raises ConfigurationError for a drone that is not in the network.
        """
        drones = {node_id: node.drone for node_id, node in self.nodes.items()}
        return Pilots(self.clock, self.air, drones, tracks)

    # Acting ----------------------------------------------------------------------------------

    def restart(self, node_id: int) -> None:
        """Restart the mesh software of a node, which loses its state."""
        self.air.run(functools.partial(self._restart, node_id))

    def _restart(self, node_id: int) -> None:
        node = self.nodes[node_id]
        node.component.stop()
        self._install(node, node_id)
        node.start()

    def power(self, node_id: int, on: bool) -> None:
        """Switch a node's antenna. Raises TypeError: the text "false" would switch it on."""
        if not isinstance(on, bool):
            raise TypeError(f"invalid on {on!r}: must be True or False")
        antenna = self.nodes[node_id].antenna
        if antenna.powered != on:
            antenna.switch_power(on)

    def set_fence(self, fence: Fence) -> None:
        """All drones keep this fence from now on. Not for drones among boxes."""
        self._fence = fence
        for node in self.nodes.values():
            node.drone.keep_to(fence)
            node.submit(node.component.on_fence)

    def internet(self, gateway: int, works: bool) -> None:
        """Give a gateway its connection to the outside world, or take it."""
        self.nodes[gateway].submit(functools.partial(self._gateway(gateway).set_internet, works))

    def order(
        self,
        node_id: int,
        x: float,
        y: float,
        height: int = 0,
        gateway: int = 0,
        allow_shared_place: bool = False,
    ) -> bool:
        """Order a drone to (x, y, height) metres through a gateway; like IGatewayCommands.

        Raises ValueError if `gateway` is not a gateway, and GoalRefused like IGatewayCommands.
        """
        taken = self._gateway(gateway).send_goal_request_to_drone(
            node_id, y, x, height, self.clock.now_s, allow_shared_place
        )
        self.nodes[gateway].plan()
        return taken

    def _gateway(self, node_id: int) -> MeshnetworkGateway:
        component = self.nodes[node_id].component
        if not isinstance(component, MeshnetworkGateway):
            raise ValueError(f"node {node_id} is a router; orders go through a gateway")
        return component

    def send(
        self, node_id: int, to: int, payload: bytes, port: int = 0, reliable: bool = True
    ) -> Ticket:
        """Send a message from a node; like Transport.send."""
        node = self.nodes[node_id]
        now_s = self.clock.now_s
        ticket = node.component.data.send(to, payload, now_s, port=port, reliable=reliable)
        node.plan()
        return ticket

    def echo(self, node_id: int, to: int, on_answer: OnEchoAnswer) -> bool:
        """Send an echo from a node to another one; False: no route."""
        node = self.nodes[node_id]
        token = node.component.data.echo(to, on_answer, self.clock.now_s)
        node.plan()
        return token is not None

    def inject(self, node_id: int, payload: bytes) -> None:
        """Deliver a packet without a sender to a node, even if its antenna has no power."""
        self.nodes[node_id].hear(payload)

    def stop(self) -> None:
        """Stop all nodes: necessary on chips, whose drivers otherwise wait for ever."""
        for node in self.nodes.values():
            self.air.run(node.component.stop)
        self.air.stop()

    def run_for(self, seconds: float) -> None:
        """Let simulated time pass."""
        self.clock.run_until(self.clock.now_s + seconds)

    def run_until(self, condition: Callable[[], bool], within_s: float) -> bool:
        """Let time pass until `condition()` is true; returns False if it is not in time."""
        deadline_s = self.clock.now_s + within_s
        while not condition():
            if self.clock.now_s >= deadline_s:
                return False
            self.clock.run_until(min(deadline_s, self.clock.now_s + STEP_S))
        return True

    def now_s(self) -> float:
        """Simulated seconds since the start."""
        return self.clock.now_s

    # Observation -----------------------------------------------------------------------------

    def status(self) -> MeshStatus:
        """The state of all nodes, like /mesh/state: for tables, samples, reports and pictures."""
        state = mesh_status(self.nodes, self.clock.now_s, self.air.max_distance_m)
        routing, repair = (
            chosen if isinstance(chosen, str) else getattr(chosen, "__name__", "")
            for chosen in (self._routing, self._repair)
        )
        fence = describe_fence(self._fence)
        return replace(state, routing=routing, repair_strategy=repair, fence=fence)

    def event_records(self) -> list[EventRecord]:
        """All events so far, like those on /mesh/events: for the story of the run."""
        return event_records(self.events)

    def connected(self, node_id: int) -> bool:
        """Whether a node is connected to a gateway."""
        return self.nodes[node_id].component.get_connected_to_gateway()

    def all_connected(self, among: Iterable[int] | None = None) -> bool:
        """Whether each of these nodes (default: all that have power, at least one) is connected."""
        if among is None:
            among = [n for n, node in self.nodes.items() if node.antenna.powered]
            return bool(among) and all(map(self.connected, among))
        return all(map(self.connected, among))

    def links(self, node_id: int) -> list[int]:
        """The nodes that a node can currently send to; none while its antenna has no power."""
        if not self.nodes[node_id].antenna.powered:
            return []
        return [n for n, antenna in self.air.in_range(node_id).items() if antenna.powered]

    def hops(self, node_id: int) -> int:
        """A node's own count of hops to its gateway."""
        return self.nodes[node_id].component.get_hops_from_gateway_away()

    def location(self, node_id: int) -> Location:
        """The position of a drone."""
        return self.nodes[node_id].drone.get_location()

    def shortest_hops(self) -> dict[int, int]:
        """By id: hops on the shortest path to a gateway, for all nodes with a path."""
        gateways = [n for n, node in self.nodes.items() if node.is_gateway and node.antenna.powered]
        return hops_from(gateways, self.links)

    def path_to_gateway(self, node_id: int) -> list[int] | None:
        """The path of a packet to the node's gateway; None: it would not arrive."""
        gateway = self.nodes[node_id].component.get_preferred_gateway()
        path = [node_id]
        while path[-1] != gateway:
            step = self.nodes[path[-1]].component.get_direction_to(gateway)
            if step == NO_ROUTE or step in path:
                return None
            path.append(step)
        return path

    def _places_of_powered(self) -> dict[int, Location]:
        nodes = self.nodes.items()
        return {node_id: self.location(node_id) for node_id, node in nodes if node.antenna.powered}

    def _places_of_connected(self) -> dict[int, Location]:
        places = self._places_of_powered().items()
        return {node_id: place for node_id, place in places if self.connected(node_id)}

    def _receive(self, node_id: int, message: ReceivedMessage) -> None:
        self.received.setdefault(node_id, []).append(message)
