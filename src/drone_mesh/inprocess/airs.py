"""The airs of an in-process network, by the name of the radio."""

from __future__ import annotations

import math
import random

from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.inprocess.shared_antenna import SharedChannel
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel
from drone_mesh.nrf24.settings import RadioSettings, data_rate


def create_air(
    radio: str,
    rng: random.Random,
    max_distance_m: float,
    loss: float,
    delay_s: float,
    jitter_s: float,
    rate: str,
    links: LinkModel | None,
) -> IInProcessAir:
    """The air for a radio, "disc", "shared" or "chips"; the other arguments as for Network.

    Raises ConfigurationError.
    """
    _check_numbers(max_distance_m, loss, delay_s, jitter_s)
    if radio == "disc":
        own_rng = random.Random(rng.random())
        return InProcessAir(VirtualClock(), own_rng, max_distance_m, loss, delay_s, jitter_s)
    settings = RadioSettings(data_rate=data_rate(rate))
    links = links or IdealDisc(max_distance_m)
    if radio == "shared":
        return SharedChannel(VirtualClock(), links, settings, max_distance_m)
    if radio == "chips":
        from drone_mesh.inprocess.chip_air import ChipAir  # needs greenlet

        return ChipAir(links, settings, max_distance_m, random.Random(rng.random()))
    raise ConfigurationError(f"invalid radio {radio!r}: use disc, shared or chips")


def _check_numbers(max_distance_m: float, loss: float, delay_s: float, jitter_s: float) -> None:
    """Raises ConfigurationError; also for NaN, which is neither below nor above a bound."""
    if not max_distance_m > 0:
        raise ConfigurationError(f"invalid max_distance_m {max_distance_m}: must be above 0")
    if not 0 <= loss <= 1:
        raise ConfigurationError(f"invalid loss {loss}: must be a share, 0..1")
    for name, value in (("delay_s", delay_s), ("jitter_s", jitter_s)):
        if not 0 <= value < math.inf:
            raise ConfigurationError(f"invalid {name} {value}: must be 0 or more")
