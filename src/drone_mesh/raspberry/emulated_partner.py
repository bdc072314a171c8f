"""EmulatedPartner: a radio to try the field tools on, and a node within its reach."""

from __future__ import annotations

import random

from drone_mesh.drone.location import Location
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.wall_clock import WallClock
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.raspberry.field_radio import FieldRadio
from drone_mesh.raspberry.range_test import answer

PARTNER_ID = 1


class EmulatedPartner:
    """Node 1 at this place; it acknowledges what it receives, and follows a range measurement."""

    def __init__(self, clock: WallClock, settings: RadioSettings, place: Location) -> None:
        self._air = Air(clock, LogDistance(random.Random()), random.Random())
        chip = EmulatedChip(self._air, "partner", place.to_vector())
        self._radio = FieldRadio(chip.spi, chip.ce, PARTNER_ID, settings, clock.runtime)
        self._ended = False
        self._answering = clock.runtime.start(self._answer, "partner")

    def other_chip(self) -> EmulatedChip:
        """The chip that the tools work on, at (0, 0, 0)."""
        return EmulatedChip(self._air, "radio")

    def close(self) -> None:
        """Stop answering."""
        self._ended = True
        self._answering.join()
        self._radio.close()

    def _answer(self) -> None:
        for _ in answer(self._radio, lambda: self._ended):
            pass
