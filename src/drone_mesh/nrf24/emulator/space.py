"""Space: what lies between antennas, and what else sends there.

Both airs, of the chips and of the fast model, get losses, fading and noise from it.
"""

from __future__ import annotations

import math
from typing import Callable

from drone_mesh.nrf24.emulator.fading import Fading, Position
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.emulator.noise import CHANNEL_MHZ, Noise


class Space:
    """Distance, obstacles, fading and noise."""

    def __init__(self, links: LinkModel) -> None:
        self.links = links
        self.fading: Fading | None = None
        # What obstacles between two places cost in dB, in both directions; infinity: they block.
        self.obstacles: Callable[[Position, Position], float] | None = None
        self.noises: list[Noise] = []

    def lost_db(self, here: Position, there: Position) -> float:
        """What obstacles between two places cost; set them before the first frame."""
        return 0.0 if self.obstacles is None else self.obstacles(here, there)

    def noise_dbm(
        self,
        place: Position,
        mhz: int,
        bits_per_s: int,
        span_ns: tuple[int, int],
        throughout: bool = False,
    ) -> float:
        """The power of the strongest noise within, or `throughout`, a span; -inf: there is none."""
        width_mhz = 2.0 if bits_per_s == 2_000_000 else CHANNEL_MHZ  # [DS 5.4]
        strongest_dbm = -math.inf
        for noise in self.noises:
            sent_dbm = noise.power_dbm(mhz, width_mhz)
            if sent_dbm > -math.inf and noise.sends(*span_ns, throughout):
                distance_m = math.dist(noise.position, place)
                power_dbm = self.links.received_dbm(distance_m, sent_dbm, mhz)
                strongest_dbm = max(strongest_dbm, power_dbm - self.lost_db(noise.position, place))
        return strongest_dbm
