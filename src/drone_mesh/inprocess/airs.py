"""The airs of an in-process network, by the name of the radio."""

from __future__ import annotations

import math
import random

from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.inprocess.shared_antenna import SharedChannel
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance
from drone_mesh.nrf24.emulator.space import Fading, Space
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
    fading: str,
    rician_k_db: float,
) -> IInProcessAir:
    """The air for a radio, "disc", "shared" or "chips"; the other arguments as for Network.

    Raises ConfigurationError.
    """
    _check_numbers(max_distance_m, loss, delay_s, jitter_s)
    if radio == "disc":
        if fading != "none":
            raise ConfigurationError("fading needs the radio shared or chips")
        own_rng = random.Random(rng.random())
        return InProcessAir(VirtualClock(), own_rng, max_distance_m, loss, delay_s, jitter_s)
    settings = RadioSettings(data_rate=data_rate(rate))
    if links is None and fading != "none":
        links = LogDistance.with_edge_at(
            max_distance_m,
            random.Random(rng.random()),
            bits_per_s=settings.data_rate.value,
        )
    links = links or IdealDisc(max_distance_m)
    if radio == "shared":
        shared = SharedChannel(VirtualClock(), links, settings, max_distance_m)
        _fade(shared.space, fading, rician_k_db, rng)
        return shared
    if radio == "chips":
        from drone_mesh.inprocess.chip_air import ChipAir  # needs greenlet

        chips = ChipAir(links, settings, max_distance_m, random.Random(rng.random()))
        _fade(chips.space, fading, rician_k_db, rng)
        return chips
    raise ConfigurationError(f"invalid radio {radio!r}: use disc, shared or chips")


def _fade(space: Space, kind: str, k_db: float, rng: random.Random) -> None:
    if kind != "none":
        links = space.links
        scale = links.metres_per_metre if isinstance(links, LogDistance) else 1.0
        own_rng = random.Random(rng.random())
        space.fading = Fading(kind, own_rng, k_db=k_db, metres_per_metre=scale)


def _check_numbers(max_distance_m: float, loss: float, delay_s: float, jitter_s: float) -> None:
    """Raises ConfigurationError; also for NaN, which is neither below nor above a bound."""
    if not max_distance_m > 0:
        raise ConfigurationError(f"invalid max_distance_m {max_distance_m}: must be above 0")
    if not 0 <= loss <= 1:
        raise ConfigurationError(f"invalid loss {loss}: must be a share, 0..1")
    for name, value in (("delay_s", delay_s), ("jitter_s", jitter_s)):
        if not 0 <= value < math.inf:
            raise ConfigurationError(f"invalid {name} {value}: must be 0 or more")
