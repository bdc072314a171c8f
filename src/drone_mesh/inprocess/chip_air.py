"""The air of a network on emulated chips: the real driver and antenna of each node.

The driver blocks, so its tasks are greenlets of a CooperativeClock. The mesh software needs none:
it runs in whatever task hands it a packet, or in the clock's events, as on the other airs.
"""

from __future__ import annotations

import functools
import math
import random
from typing import Callable, Iterable

from drone_mesh.channel.runtime import Task
from drone_mesh.inprocess.clock import TaskClock
from drone_mesh.inprocess.interfaces import Host, IInProcessAir, IInProcessAntenna
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings

FLIGHT_STEP_S = 0.1  # a flying antenna moves in steps of this


class ChipAntenna(NRF24HighLevelInterface, IInProcessAntenna):
    """One node's chip, driver and antenna."""

    def __init__(self, air: ChipAir, host: Host, rng: random.Random) -> None:
        clock = air.clock.tasks
        place = host.drone.get_location().to_vector()
        self.chip = EmulatedChip(air.air, f"node {host.node_id}", place)
        driver = NRF24LowLevelInterface(
            self.chip.spi,
            self.chip.ce,
            self.chip.irq,
            node_id=host.node_id,
            settings=air.settings,
            runtime=clock,
            rng=rng,
        )
        super().__init__(driver, host.submit, runtime=clock)
        self._drone = host.drone
        self._air = air

    def send_message_to(self, payload: bytes) -> bool:
        self._air.on_packet(payload)
        return super().send_message_to(payload)

    def broadcast_message(self, payload: bytes) -> None:
        self._air.on_packet(payload)
        super().broadcast_message(payload)

    def switch_power(self, on: bool) -> None:
        """Power on or off, as soon as the driver has done so."""
        self._air.run(functools.partial(super().switch_power, on))

    def move(self) -> None:
        """Move the chip to where its drone is."""
        self.chip.position = self._drone.get_location().to_vector()


class ChipAir(IInProcessAir):
    """The emulated chips of a network and the air between them."""

    clock: TaskClock

    def __init__(
        self, links: LinkModel, settings: RadioSettings, max_distance_m: float, rng: random.Random
    ) -> None:
        """`max_distance_m`: the range for pictures and path searches."""
        self.clock = TaskClock()
        self.air = Air(self.clock.tasks, links, rng)
        self.space = self.air.space  # the obstacles, fading and noise between the antennas
        self.settings = settings
        self.max_distance_m = max_distance_m
        self.antennas: dict[int, ChipAntenna] = {}  # by node
        self._flying: set[int] = set()
        self._stepping = False
        self._tasks: list[Task] = []

    @property
    def delivered(self) -> int:
        return sum(antenna.statistics().received for antenna in self.antennas.values())

    @property
    def frames(self) -> int:
        """Frames sent so far."""
        return self.air.frames

    @property
    def collisions(self) -> int:
        """Receptions that another frame destroyed."""
        return self.air.collisions

    @property
    def airtime_s(self) -> float:
        """The airtime of all frames together, in seconds."""
        return self.air.airtime_s

    def antenna(self, host: Host, rng: random.Random) -> ChipAntenna:
        antenna = self.antennas[host.node_id] = ChipAntenna(self, host, rng)
        return antenna

    def run(self, function: Callable[[], None]) -> None:
        """Run it in a task of its own, because drivers wait for their chips."""
        self._tasks.append(self.clock.tasks.start(function, "node"))

    def stop(self) -> None:
        for task in self._tasks:
            task.join()

    def in_range(self, node: int) -> dict[int, ChipAntenna]:
        """By id: the antennas that a node could reach on an undisturbed channel."""
        return {
            other: antenna
            for other, antenna in self.antennas.items()
            if other != node and self._reaches(self.antennas[node], antenna)
        }

    def _reaches(self, one: ChipAntenna, other: ChipAntenna) -> bool:
        settings = self.settings
        here, there = one.chip.position, other.chip.position
        distance_m, links = math.dist(here, there), self.space.links
        power_dbm = links.received_dbm(
            distance_m, float(settings.power.value), 2400 + settings.channel
        ) - self.space.lost_db(here, there)
        return power_dbm > -math.inf and links.reaches(
            distance_m, power_dbm, settings.data_rate.value
        )

    def flight(self, node: int, started: bool) -> None:
        (self._flying.add if started else self._flying.discard)(node)
        self.moved((node,))
        if not self._stepping:
            self._stepping = True
            self._plan_step()

    def moved(self, nodes: Iterable[int]) -> None:
        for node in nodes:
            self.antennas[node].move()

    def _plan_step(self) -> None:
        self.clock.call_at(self.clock.now_s + FLIGHT_STEP_S, self._step, None)

    def _step(self, _: object) -> None:
        self.moved(self._flying)
        self._stepping = bool(self._flying)
        if self._stepping:
            self._plan_step()
