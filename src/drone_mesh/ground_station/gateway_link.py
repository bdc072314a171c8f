"""GatewayLink: a real gateway's connection to ground stations."""

from __future__ import annotations

from typing import Callable

from drone_mesh.communication.events.observer import MeshEvent
from drone_mesh.communication.interfaces import MAX_NODE_ID, IGatewayCommands, IInternetConnection
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.execution import Submit, Work
from drone_mesh.ground_station.server import GroundStationServer
from drone_mesh.ground_station.settings import GroundStationSettings
from drone_mesh.ground_station.vehicles import vehicles_of_gateway
from drone_mesh.state.model import EventRecord

SHOW_PERIOD_S = 1.0


class GatewayLink(IInternetConnection):
    """Shows ground stations what the gateway knows, and passes their orders to it."""

    def __init__(
        self,
        settings: GroundStationSettings,
        origin: Origin | None,
        period_s: float,
        engine: IDroneEngine,
        submit: Submit,
        call_every: Callable[[float, Work], Callable[[], None]],
    ) -> None:
        """`engine`: of the gateway, on whose thread `submit` and `call_every` run a function.

        `call_every` returns what ends that. For the rest see GroundStationServer.
        """
        self._server = GroundStationServer(settings, origin, period_s, self._order)
        self._engine, self._submit, self._call_every = engine, submit, call_every
        self._gateway: MeshnetworkGateway | None = None
        self._end_showing: Callable[[], None] = lambda: None

    def connect(self, commands: IGatewayCommands) -> None:
        assert isinstance(commands, MeshnetworkGateway)
        self._gateway = commands
        self._server.start()
        self._end_showing = self._call_every(SHOW_PERIOD_S, self._show)

    def disconnect(self) -> None:
        self._end_showing()
        self._server.stop()

    def observe(self, event: MeshEvent) -> None:
        kind, node, now_s, peer, detail, order, place = event
        peers = (peer,) if peer <= MAX_NODE_ID else ()
        self._server.tell(EventRecord(now_s, node, kind.value, peers, detail, order, place))

    def _show(self, now_s: float) -> None:
        assert self._gateway is not None
        self._server.show(vehicles_of_gateway(self._gateway, self._engine, now_s), now_s)

    def _order(self, node: int, goal: Location, answer: Callable[[str], None]) -> None:
        def order(now_s: float) -> None:
            assert self._gateway is not None
            place = goal.latitude, goal.longitude, int(goal.height)
            try:
                taken = self._gateway.send_goal_request_to_drone(node, *place, now_s)
            except GoalRefused as error:
                answer(str(error))
            else:
                answer("" if taken else "the gateway has no route to it")

        self._submit(order)
