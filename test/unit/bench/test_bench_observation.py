"""What the benchmark concludes from the observations of its probe."""

import pytest

from drone_mesh.bench.observation import (
    CONNECTED,
    DISCONNECTED,
    STARTED,
    Figures,
    Happening,
    StateSample,
    Watch,
    first_time_all_connected,
    from_line,
    to_line,
)


def sample(sim_s, on, connected, wall_s=0.0):
    return StateSample(wall_s, sim_s, on=on, connected=connected, messages=0, flying=0, links=0)


def watch_of(drones, *sights):
    watch = Watch(drones)
    for sight in sights:
        watch.see(sight)
    return watch


@pytest.mark.parametrize(
    "sight",
    [sample(1.5, 3, 2), Happening(0.25, 7, CONNECTED), Figures("air", 1.0, {"delivered": 12.0})],
)
def test_what_the_probe_prints_is_parsed_unchanged(sight):
    assert from_line(to_line(sight)) == sight


@pytest.mark.parametrize(
    "line", ["", "{}", "[ WARN] something", '{"kind": "StateSample"}', '{"kind": 1}']
)
def test_an_invalid_line_is_refused(line):
    with pytest.raises(ValueError, match="probe"):
        from_line(line)


def test_the_time_to_connect_is_counted_from_the_last_start_by_the_stamps_of_the_events():
    watch = watch_of(
        3,
        Happening(1.0, 0, STARTED),
        Happening(1.1, 1, STARTED),
        Happening(1.4, 2, STARTED),
        Happening(1.2, 1, CONNECTED),
        Happening(1.9, 2, CONNECTED),
        sample(2.5, on=3, connected=2),
    )
    assert watch.connected_after_s() == pytest.approx(0.5)


def test_without_the_first_events_the_states_give_the_time_to_connect():
    watch = watch_of(
        3,
        Happening(1.4, 2, STARTED),
        Happening(1.9, 2, CONNECTED),
        sample(1.5, on=3, connected=1),
        sample(2.0, on=3, connected=1),
        sample(2.5, on=3, connected=2),
    )
    assert watch.connected_after_s() == pytest.approx(1.0)


def test_a_fleet_connected_before_its_last_node_started_took_no_time():
    watch = watch_of(
        2,
        Happening(1.0, 1, STARTED),
        Happening(1.1, 1, CONNECTED),
        Happening(1.3, 0, STARTED),
        sample(1.5, on=2, connected=1),
    )
    assert watch.connected_after_s() == 0.0


def test_a_fleet_that_is_never_wholly_connected_has_no_time_to_connect():
    watch = watch_of(3, sample(1.0, on=3, connected=1), sample(90.0, on=3, connected=1))
    assert watch.connected_after_s() is None
    assert watch.all_connected is None


def test_connected_routers_do_not_count_as_all_while_a_node_is_missing():
    watch = watch_of(3, sample(1.0, on=2, connected=2), sample(2.0, on=3, connected=2))
    assert watch.all_connected == sample(2.0, on=3, connected=2)


def test_a_router_that_lost_its_connection_again_is_waited_for():
    happenings = [
        Happening(1.0, 1, CONNECTED),
        Happening(2.0, 1, DISCONNECTED),
        Happening(3.0, 2, CONNECTED),
        Happening(5.0, 1, CONNECTED),
        Happening(6.0, 2, DISCONNECTED),
    ]
    assert first_time_all_connected(happenings, routers=2) == 5.0
    assert first_time_all_connected(happenings[:4][::-1], routers=2) == 5.0
    assert first_time_all_connected(happenings[:3], routers=2) is None


def test_figures_add_up_over_their_sources_and_the_worst_is_remembered():
    watch = watch_of(
        2,
        Figures("host a", 1.0, {"lag": 0.5, "sent": 1.0}),
        Figures("host b", 3.0, {"lag": 0.1, "sent": 10.0}),
        Figures("host a", 2.0, {"lag": 0.2, "sent": 3.0}),
    )
    assert watch.total("sent") == 13.0
    assert watch.worst["lag"] == 0.5
    assert watch.received_s("sent") == 3.0
    assert watch.total("unheard of") is None
    assert watch.received_s("unheard of") == 0.0


def test_connections_lost_before_the_measurement_do_not_count():
    watch = watch_of(
        3,
        Happening(4.0, 1, DISCONNECTED),
        Happening(5.0, 1, CONNECTED),
        sample(6.0, on=3, connected=2),
        Happening(7.0, 1, DISCONNECTED),
        Happening(7.5, 2, DISCONNECTED),
        Happening(8.0, 1, CONNECTED),
    )
    assert watch.disconnected_since(6.0) == 2
