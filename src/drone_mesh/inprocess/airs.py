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
from drone_mesh.nrf24.emulator.space import Fading
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
    for name, value, is_right, rule in (  # NaN is neither below nor above a bound
        ("max_distance_m", max_distance_m, max_distance_m > 0, "above 0"),
        ("loss", loss, 0 <= loss <= 1, "a share, 0..1"),
        ("delay_s", delay_s, 0 <= delay_s < math.inf, "0 or more"),
        ("jitter_s", jitter_s, 0 <= jitter_s < math.inf, "0 or more"),
    ):
        if not is_right:
            raise ConfigurationError(f"invalid {name} {value}: must be {rule}")
    if radio == "disc":
        if fading != "none":
            raise ConfigurationError("fading needs the radio shared or chips")
        own_rng = random.Random(rng.random())
        return InProcessAir(VirtualClock(), own_rng, max_distance_m, loss, delay_s, jitter_s)
    settings = RadioSettings(data_rate=data_rate(rate))
    if links is None and fading != "none":
        own_rng, bits_per_s = random.Random(rng.random()), settings.data_rate.value
        links = LogDistance.with_edge_at(max_distance_m, own_rng, bits_per_s=bits_per_s)
    links = links or IdealDisc(max_distance_m)
    air: SharedChannel | ChipAir
    if radio == "shared":
        air = SharedChannel(VirtualClock(), links, settings, max_distance_m)
    elif radio == "chips":
        from drone_mesh.inprocess.chip_air import ChipAir  # needs greenlet

        air = ChipAir(links, settings, max_distance_m, random.Random(rng.random()))
    else:
        raise ConfigurationError(f"invalid radio {radio!r}: use disc, shared or chips")
    if fading != "none":
        scale = links.metres_per_metre if isinstance(links, LogDistance) else 1.0
        own_rng = random.Random(rng.random())
        air.space.fading = Fading(fading, own_rng, k_db=rician_k_db, metres_per_metre=scale)
    return air
