"""MeshnetworkRouter: keeps a connection to a gateway, and flies back if it is lost for too long.

docs/protocol.md, "Connection", and docs/repair.md. `router_states` has its states and transitions.
"""

from __future__ import annotations

import random

from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.control.router_states import RouterStates
from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.communication.node.component import (
    AS_IN_THE_DOCUMENT,
    MeshnetworkComponent,
    NodeSettings,
)
from drone_mesh.communication.node.flights import RouterFlights
from drone_mesh.communication.node.whereabouts import RouterWhereabouts
from drone_mesh.communication.repair.connection_repair import ConnectionRepair
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.status import RepairStatus
from drone_mesh.communication.repair.strategies import Thesis
from drone_mesh.drone.interfaces import IDroneEngine


class MeshnetworkRouter(MeshnetworkComponent):
    """A node that forwards packets for others and is not a gateway."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: ITechnique,
        rng: random.Random,
        repair: IRepairStrategy | None = None,
        settings: NodeSettings = AS_IN_THE_DOCUMENT,
    ) -> None:
        """Like MeshnetworkComponent; the default of `repair` is Thesis."""
        self._states = states = RouterStates()
        super().__init__(node_id, antenna, engine, routing, rng, states, settings)
        control, deadlines, pilot = self.control, self._deadlines, self._pilot
        requests = PlaceRequests(node_id, pilot, antenna, control.delivery, deadlines)
        self._repair = ConnectionRepair(
            node_id,
            states,
            control,
            self._options,
            self._timing,
            deadlines,
            antenna,
            engine,
            pilot,
            requests,
            self.places,
            self._report,
            repair or Thesis(),
            self._has_key,
        )
        self._whereabouts = RouterWhereabouts(
            node_id,
            control,
            deadlines,
            pilot,
            antenna,
            self.places,
            self._frame,
            self._options.clearance_m,
            self._has_key,
            self._claims,
            self._repair,
        )
        self._flights = RouterFlights(
            pilot,
            control,
            self._orders,
            self._report,
            requests,
            deadlines,
            states,
            self._repair,
            antenna,
        )
        self._orders.flights = self._flights
        self._parts += [self._repair, self._whereabouts, self._flights]

    def get_repair_status(self) -> RepairStatus:
        return self._repair.status()

    def _check(self, due_s: float) -> None:
        super()._check(due_s)
        if self._states.connected:
            self.places.connected_here(self._pilot.place(), self.control.hops)
            self._repair.on_connected_check()

    def _antenna_is_off(self) -> None:
        self._repair.on_antenna_off()

    def _on_neighbour_found(self, node: int) -> None:
        self._repair.on_neighbour_found(node)

    # For the control plane -------------------------------------------------------------------

    def may_connect(self, node: int, know_gateway: bool) -> bool:
        """See ConnectionRepair; also for the functions below."""
        if self._states.nothing_to_repair:  # it does not fly; most packets
            return True
        return self._repair.may_connect(node, know_gateway)

    def on_connected(self) -> None:  # noqa: D102
        self._own_id.connected()
        self.places.connected_here(self._pilot.place(), self.control.hops)
        self._repair.on_connected()

    def on_unconnected_check(self, due_s: float) -> None:  # noqa: D102
        self._repair.on_unconnected_check(due_s)

    def on_neighbour_lost(self, node: int) -> None:  # noqa: D102
        self._repair.on_neighbour_lost(node)
