"""Fading, obstacles and noise around a whole mesh: the same on chips and on the fast model."""

from __future__ import annotations

import math
import random

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.space import Noise
from drone_mesh.nrf24.settings import RadioSettings

MHZ = 2400 + RadioSettings().channel
RADIOS = pytest.mark.parametrize("radio", ["shared", "chips"])


def fleet(radio, seed=1, **options):
    options.setdefault("links", LogDistance.with_edge_at(9.0, random.Random(seed)))
    network = Network(seed, radio=radio, **options)
    network.add_fleet(gateways=1, routers=9, gridsize=3, spacing=6.0)
    assert network.run_until(network.all_connected, within_s=60.0)
    return network


def noise(place, power_dbm, **how):
    return Noise(place, power_dbm, random.Random(2), centre_mhz=MHZ, **how)


@RADIOS
def test_a_jammer_with_power_cuts_those_near_it_until_it_stops(radio):
    network = fleet(radio)
    jammer = noise((12.0, 12.0, 0.0), 0.0)
    network.air.space.noises.append(jammer)
    before = network.air.collisions
    assert network.run_until(lambda: not network.connected(9), within_s=120.0)
    assert network.air.collisions > before
    jammer.stop(round(network.now_s() * 1e9))
    assert network.run_until(network.all_connected, within_s=240.0)
    network.stop()


@RADIOS
def test_a_jammer_on_another_channel_disturbs_nobody(radio):
    network = fleet(radio)
    jammer = Noise((6.0, 6.0, 0.0), 20.0, random.Random(2), centre_mhz=MHZ + 40, width_mhz=20.0)
    network.air.space.noises.append(jammer)
    network.run_for(60.0)
    assert network.all_connected()
    network.stop()


@RADIOS
def test_obstacles_take_links_away_and_packets_go_round_them(radio):
    network = Network(1, radio=radio)
    network.air.space.obstacles = lambda a, b: math.inf if {a, b} == WALL else 0.0
    for node, (x, y) in enumerate(SQUARE):
        (network.add_router if node else network.add_gateway)(node, x, y)
    assert network.run_until(network.all_connected, within_s=60.0)
    network.run_for(30.0)
    assert 1 not in network.links(0)
    assert network.path_to_gateway(1) in ([1, 2, 0], [1, 3, 0])
    network.stop()


SQUARE = ((0.0, 0.0), (6.0, 0.0), (3.0, 5.0), (3.0, -5.0))
WALL = {(0.0, 0.0, 0.0), (6.0, 0.0, 0.0)}


@RADIOS
def test_fading_changes_what_arrives_and_the_same_seed_gives_the_same_fading(radio):
    def run(fading):
        network = Network(3, radio=radio, fading=fading)
        network.add_fleet(gateways=1, routers=9, gridsize=3, spacing=6.0)
        network.run_for(30.0)
        network.stop()
        return network.air.frames, network.air.collisions, network.air.airtime_s

    assert run("rayleigh") == run("rayleigh")
    assert run("rayleigh") != run("rician")


def test_the_disc_does_not_fade_and_an_unknown_fading_is_refused():
    with pytest.raises(ConfigurationError, match="fading needs the radio shared or chips"):
        Network(fading="rayleigh")
    with pytest.raises(ConfigurationError, match="invalid fading 'rice'"):
        Network(radio="shared", fading="rice")
