"""Timing of a mesh on this radio: the rules of access and the properties of the channel."""

from __future__ import annotations

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.communication.medium import Medium
from drone_mesh.nrf24.settings import DataRate, RadioSettings

CYCLE_S = {DataRate.KBPS_250: 2.6e-3, DataRate.MBPS_1: 1.1e-3, DataRate.MBPS_2: 0.9e-3}


def access_rules(settings: RadioSettings) -> AccessRules:
    """The rules for radios with these settings."""
    return AccessRules.for_cycle(CYCLE_S[settings.data_rate])


def medium_of(settings: RadioSettings) -> Medium:
    """The properties of a channel with these settings, for the mesh."""
    return Medium.for_hop(CYCLE_S[settings.data_rate])
