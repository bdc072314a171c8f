"""The real mesh core on real drivers on emulated chips: Network(radio="chips")."""

from __future__ import annotations

import random
from collections import Counter

import pytest
from scenarios import placed

from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance

# casus.yaml, layout 101: three rows of two behind a gateway
GATEWAY = (-1.0, 0.0)
LAYOUT_101 = {1: (-3, 4), 2: (3, 4), 3: (-3, 10), 4: (3, 10), 5: (-3, 16), 6: (3, 16)}
# The chip hears further than 9 m, as it does in reality: at this scale the same links exist.
METRES_OF_THE_FIELD = 10.0


def layout_101(links: LinkModel, scale: float = 1.0, seed: int = 1) -> Network:
    places = [(x_m * scale, y_m * scale) for x_m, y_m in (GATEWAY, *LAYOUT_101.values())]
    return placed(places, seed=seed, radio="chips", links=links)


@pytest.fixture(params=["disc", "log-distance"])
def mesh(request):
    if request.param == "disc":
        mesh = layout_101(IdealDisc(9.0))
    else:
        # Links of 6 m (and 6.3 and 4.5 m to the gateway) lie inside, those of 8.5 m outside.
        edge_m = 7.5 * METRES_OF_THE_FIELD
        links = LogDistance.with_edge_at(edge_m, random.Random("links"))
        mesh = layout_101(links, METRES_OF_THE_FIELD)
    yield mesh
    mesh.stop()


def misuses(mesh):
    return [text for antenna in mesh.air.antennas.values() for text in antenna.chip.warnings]


def hops(mesh):
    return [mesh.hops(node) for node in LAYOUT_101]


def test_layout_101_connects_with_the_hops_of_2019_and_detours_when_router_3_is_off(mesh):
    assert mesh.run_until(mesh.all_connected, within_s=60.0), hops(mesh)
    assert mesh.run_until(lambda: hops(mesh) == [1, 1, 2, 2, 3, 3], within_s=120.0), hops(mesh)
    mesh.power(3, False)
    mesh.run_for(1.0)
    node_5 = mesh.nodes[5].component
    assert mesh.run_until(
        lambda: node_5.get_connected_to_gateway() and node_5.get_route_to_gateway() in (4, 6),
        within_s=120.0,
    ), f"node 5 found no way round node 3; hops {hops(mesh)}"
    assert mesh.run_until(mesh.all_connected, within_s=60.0), hops(mesh)
    assert misuses(mesh) == []
    for node in mesh.nodes.values():
        statistics = node.antenna.statistics()
        assert statistics.sent == statistics.acknowledged + statistics.lost


def test_a_drone_takes_its_chip_along_and_a_restarted_node_comes_back():
    mesh = Network(3, radio="chips")
    mesh.add_fleet(gateways=1, routers=9, gridsize=3, spacing=6.0)
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    before = mesh.links(9)
    assert mesh.order(9, 12.0, 18.0)
    mesh.run_for(1.0)
    assert mesh.nodes[9].drone.path is not None
    assert mesh.run_until(lambda: mesh.nodes[9].drone.path is None, within_s=30.0)
    assert mesh.nodes[9].antenna.chip.position == mesh.location(9).to_vector() == (12.0, 18.0, 0.0)
    assert mesh.links(9) != before
    mesh.restart(2)
    mesh.run_for(1.0)
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    assert misuses(mesh) == []
    mesh.stop()


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_a_drone_whose_chip_answers_no_more_does_not_fly_until_it_does(routing):
    mesh = Network(3, radio="chips", routing=routing)
    mesh.add_fleet(gateways=1, routers=3, gridsize=2, spacing=6.0)
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    here, chip = mesh.location(3), mesh.nodes[3].antenna.chip
    chip.faults.miso_stuck_at = 0xFF
    mesh.run_for(150.0)
    said = mesh.nodes[3].component.get_repair_status().in_words(mesh.now_s())
    assert "its radio does not work" in said
    assert mesh.location(3) == here
    chip.faults.miso_stuck_at = None
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    mesh.stop()


def test_the_same_seed_gives_the_same_mesh():
    def run(seed):
        mesh = layout_101(IdealDisc(9.0), seed=seed)
        mesh.run_for(20.0)
        mesh.stop()
        return mesh.air.frames, mesh.air.collisions, hops(mesh)

    assert run(3) == run(3)
    assert run(3) != run(4)


def grid(nodes, seed=1):
    mesh = Network(seed, radio="chips")
    mesh.add_fleet(1, nodes - 1, round((nodes - 1) ** 0.5), 6.0)
    return mesh


@pytest.mark.slow
def test_26_nodes_on_one_channel_connect_and_stay_connected():
    mesh = grid(26)
    assert mesh.run_until(mesh.all_connected, within_s=12.0)
    seconds, connected = 60, 0
    for _ in range(seconds):
        mesh.run_for(1.0)
        connected += sum(mesh.hops(node) != 255 for node in mesh.nodes if node)
    assert connected / seconds / 25 >= 0.998
    assert mesh.air.collisions < 0.4 * mesh.air.frames
    assert misuses(mesh) == []
    mesh.stop()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed_m_s", "fading"), [(0.0, "none"), (0.3, "rician"), (0.0, "rayleigh")]
)
def test_the_fast_model_agrees_with_the_chips_also_where_drones_move_and_links_fade(
    speed_m_s, fading
):
    """Half a minute of 17 nodes after 20 s at rest; experiments/model.yaml shows more."""

    def run(radio):
        total = Counter()
        for seed in range(1, 7):  # four of them differ by as much as the tolerance
            network = Network(seed, radio=radio, fading=fading)
            network.add_fleet(1, 16, 4, 6.0)
            network.run_for(20.0)
            if speed_m_s:
                places = {node: network.location(node).to_vector() for node in network.nodes}
                motion = Mobility("random_waypoint", speed_m_s=(speed_m_s, speed_m_s))
                area = Area(0.0, 0.0, 24.0, 24.0)
                network.fly(tracks_of(motion, places, {0}, area, seed))
            before = Counter(frames=network.air.frames, collisions=network.air.collisions)
            network.run_for(30.0)
            total += Counter(frames=network.air.frames, collisions=network.air.collisions) - before
            network.stop()
        return total

    chips, model = run("chips"), run("shared")
    assert model["frames"] == pytest.approx(chips["frames"], rel=0.2)
    collided = chips["collisions"] / chips["frames"]
    assert model["collisions"] / model["frames"] == pytest.approx(collided, abs=0.06)
