"""The command lines of raspberry_router and raspberry_gateway."""

from __future__ import annotations

import re

import pytest

from drone_mesh.communication.node.node_configuration import NodeConfiguration
from drone_mesh.communication.repair.options import LostMesh, LostPlace, RepairOptions
from drone_mesh.communication.seals.keys import MeshKey, write_key_file
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone import Location
from drone_mesh.drone.engines import FlightOptions
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.ground_station.settings import NO_STATIONS
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.nrf24.settings import BroadcastMode, DataRate, RadioSettings, TxPower
from drone_mesh.raspberry.connection_options import AirAddress, AirOptions
from drone_mesh.raspberry.options import Options, parse_gateway, parse_router
from drone_mesh.raspberry.wiring_options import Hardware

TOKEN = "0123456789abcdef"


def test_a_router_needs_only_its_id_and_has_the_documented_settings():
    assert parse_router(["--id", "3"], {}) == Options(
        node_id=3,
        hardware=Hardware((0, 0), ce_gpio=25, irq_gpio=None),
        radio=RadioSettings(),
        mesh=NodeConfiguration(
            "child_table_tree",
            "thesis",
            MeshTiming(report_period_s=30.0),
            RepairOptions(clearance_m=5.0, range_m=100.0),
        ),
        location=None,
        flight=FlightOptions(),
        air=AirOptions(),
        emulated=0,
        trace=None,
        log_level="info",
        gateway=False,
        http=None,
    )


def test_a_router_answers_over_http_only_if_it_is_asked_to():
    asked = parse_router(["--id", "3", "--http", "--port", "9081"], {})
    assert (asked.gateway, asked.http) == (False, HttpSettings("127.0.0.1", 9081, ""))
    assert parse_gateway([], {}).gateway


@pytest.fixture
def key_files(tmp_path):
    """A mesh key and the keys of node 5."""
    key = MeshKey(bytes(range(16)))
    write_key_file(tmp_path / "mesh.key", key)
    write_key_file(tmp_path / "node5.key", key.for_node(5))
    return tmp_path


def test_a_node_gets_the_keys_in_its_file(key_files):
    gateway = parse_gateway(["--key-file", str(key_files / "mesh.key")], {})
    assert isinstance(gateway.keys, MeshKey)
    router = parse_router(["--id", "5", "--key-file", str(key_files / "node5.key")], {})
    assert router.keys.authority_over(5) == gateway.keys.authority_over(5)
    assert parse_router(["--id", "5"], {}).keys is None


@pytest.mark.parametrize(
    ("parse", "arguments", "error"),
    [
        (parse_gateway, "--key-file node5.key", "a gateway needs the mesh key"),
        (parse_router, "--emulated 3 --key-file node5.key", "emulated nodes need the mesh key"),
        (parse_router, "--id 4 --key-file node5.key", "the keys are those of node 5, not 4"),
        (parse_router, "--id 4 --key-file none.key", "No such file"),
        (parse_router, "--id 4 --key-file open.key", "other users can access it"),
    ],
)
def test_keys_that_a_node_cannot_use_are_refused(
    key_files, monkeypatch, capsys, parse, arguments, error
):
    monkeypatch.chdir(key_files)
    (key_files / "open.key").write_text("")
    (key_files / "open.key").chmod(0o644)
    with pytest.raises(SystemExit) as ended:
        parse(arguments.split(), {})
    assert ended.value.code == 2
    assert error in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("9100", AirAddress("127.0.0.1", 9100)),
        ("pi:9100", AirAddress("pi", 9100)),
        ("[::1]:9100", AirAddress("::1", 9100)),
    ],
)
def test_a_shared_air_is_joined_or_served_at_an_address(text, address):
    router = parse_router(["--id", "3", "--emulated-air", text], {})
    assert router.air == AirOptions(join=address)
    assert parse_gateway(["--emulated-air-serve", text], {}).air == AirOptions(serve=address)


def test_each_option_reaches_what_it_is_for():
    line = (
        "--id 253 --spi 1.2 --spi-hz 1000000 --ce 22 --irq 24 --channel 76 --rate 2M --crc 8 "
        "--power -12 --broadcast shockburst "
        "--check-period 5 --connection-lost-after 60 --report-period 45 "
        "--latitude 10 --longitude -20.5 "
        "--height 3 --debug 2.5 --log-level debug --repair home --clearance 3 --range 40 "
        "--lost-place above --lost-mesh return --lost-mesh-after 90 "
        "--routing drone_mesh.communication.routing.child_table_tree:"
        "ChildTableTree "
        "--drone mavlink:/dev/serial0,921600 --origin 52.0907,5.1214,3 --max-height 40 "
        "--max-distance 200 --speed 3 --min-battery 25 --cruise-height 8 --layers 1.5 --hover 12 "
        "--may-arm --may-take-off --may-change-mode --orders-may-take-back 60"
    )
    assert parse_router(line.split(), {}) == Options(
        node_id=253,
        hardware=Hardware((1, 2), ce_gpio=22, irq_gpio=24, spi_hz=1_000_000),
        radio=RadioSettings(
            channel=76,
            data_rate=DataRate.MBPS_2,
            power=TxPower.DBM_MINUS_12,
            crc_bytes=1,
            broadcast_mode=BroadcastMode.SHOCKBURST,
        ),
        mesh=NodeConfiguration(
            "drone_mesh.communication.routing.child_table_tree:ChildTableTree",
            "home",
            MeshTiming(5.0, 60.0, report_period_s=45.0),
            RepairOptions(3.0, 40.0, LostPlace.ABOVE, LostMesh.RETURN, 90.0),
        ),
        location=Location(latitude=10.0, longitude=-20.5, height=3.0),
        flight=FlightOptions(
            "mavlink:/dev/serial0,921600",
            Origin(52.0907, 5.1214, 3.0),
            FlightLimits(40.0, 200.0, 3.0, 25.0, 8.0, 1.5, 12.0),
            Permissions(True, True, True, orders_may_take_back_s=60.0),
        ),
        air=AirOptions(),
        emulated=0,
        trace=None,
        debug_period_s=2.5,
        log_level="debug",
        gateway=False,
        http=None,
    )


def test_a_value_south_or_west_of_the_origin_is_not_taken_for_an_option():
    line = "--id 3 --origin -33.86,151.21,3 --latitude -.5 --longitude -1e1 --power -6"
    options = parse_router(line.split(), {})
    assert options.flight.origin == Origin(-33.86, 151.21, 3.0)
    assert options.location == Location(latitude=-0.5, longitude=-10.0, height=0.0)
    assert options.radio.power is TxPower.DBM_MINUS_6


def test_a_gateway_is_node_0_and_serves_this_machine_alone():
    options = parse_gateway([], {})
    assert options.node_id == 0
    assert options.http == HttpSettings("127.0.0.1", 9080, token="")


def test_the_token_comes_from_the_environment_or_from_a_file_which_wins(tmp_path):
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    file.chmod(0o600)
    environment = {"DRONE_MESH_TOKEN": "of the environment it is"}
    assert parse_gateway([], environment).http.token == "of the environment it is"
    assert parse_gateway(["--token-file", str(file)], environment).http.token == TOKEN
    names = ["--name", "gateway.field", "--name", "field.lan"]
    assert parse_gateway(names, {}).http.names == ("gateway.field", "field.lan")


def test_emulated_nodes_need_no_id():
    assert parse_router(["--emulated", "5"], {}).emulated == 5


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("", "one of the arguments --id --emulated is required"),
        ("--id 3 --emulated 5", "not allowed with argument"),
        ("--id 254", "invalid value '254': must be a whole number 0..253"),
        ("--id 3 --spi 0", "invalid SPI device '0'"),
        ("--id 3 --channel 126", "invalid value '126': must be a whole number 0..125"),
        ("--id 3 --check-period 0", "invalid check_period 0.0: expected seconds, 0.1..3600"),
        ("--id 3 --check-period nan", "invalid check_period nan: expected seconds, 0.1..3600"),
        (
            "--id 3 --routing gossip",
            "technique 'gossip': use one of babel, batman, beacon, child_table_tree",
        ),
        (
            "--id 3 --repair hope",
            "unknown repair strategy 'hope': use one of c3r, fiedler, field, follow",
        ),
        ("--id 3 --clearance 0", "invalid clearance 0.0: expected metres, above 0, at most 100"),
        ("--id 3 --range nan", "invalid range nan: expected metres, above 0, at most 10000"),
        ("--id 3 --latitude 5", "--latitude and --longitude: give both, or neither"),
        ("--id 3 --latitude 5001 --longitude 0", "latitude 5001 m is outside -5000..5000 m"),
        ("--id 3 --latitude 0 --longitude inf", "longitude inf is not a finite number"),
        ("--id 3 --drone mavlink:/dev/serial0,57600", "--drone mavlink: needs --origin"),
        ("--id 3 --origin 52,5", "invalid origin '52,5': use LAT,LON,ALT"),
        ("--id 3 --max-height 501", "--max-height 501 is outside"),
        ("--emulated 3 --drone package.module:Class", "--drone is for a single node"),
        ("--id 3 --trace air.pcapng", "--trace needs --emulated"),
        ("--id 3 --debug -1", "must be a number 0..3600"),
        ("--id 3 --log-level loud", "invalid choice: 'loud'"),
        ("--id 3 --port 9081", "--port needs --http"),
    ],
)
def test_a_wrong_option_ends_the_program_with_status_2_and_the_reason(capsys, line, reason):
    with pytest.raises(SystemExit) as ended:
        parse_router(line.split(), {})
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert re.search(reason, said)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("--bind 0.0.0.0", "0.0.0.0: other machines can reach it; set a token.*--token-file"),
        ("--port 0", "invalid value '0': must be a whole number 1..65535"),
        ("--token-file /no/such/file", ": --token-file /no/such/file: No such file or directory$"),
        ("--token-file /", "--token-file /: Is a directory$"),
        ("--key-file /no/such/file", ": --key-file /no/such/file: No such file or directory$"),
        (
            "--mqtt mqtts://u@h/m --mqtt-password-file /dev/null",
            "--mqtt-password-file /dev/null: not a regular file",
        ),
        ("--token-file /dev/null", "--token-file /dev/null: not a regular file"),
    ],
)
def test_a_wrong_option_of_the_gateway_is_named(capsys, line, reason):
    with pytest.raises(SystemExit):
        parse_gateway(line.split(), {})
    assert re.search(reason, capsys.readouterr().err)


@pytest.mark.parametrize("parse", [parse_router, parse_gateway])
def test_help_names_the_defaults_and_ends_with_status_0(capsys, parse):
    with pytest.raises(SystemExit) as ended:
        parse(["--help"], {})
    assert ended.value.code == 0
    assert "pin 22 of the header" in capsys.readouterr().out.replace("\n" + " " * 24, " ")


def test_a_gateway_knows_its_ground_stations(tmp_path):
    key = tmp_path / "passphrase"
    key.write_text("0123456789abcdef")
    key.chmod(0o600)
    line = "--ground-station udp:pi:14550 --ground-station tcp:0.0.0.0:5760 --cot udp:a:6969"
    orders = ["--ground-station-may-order", "--ground-station-key-file", str(key)]
    settings = parse_gateway([*line.split(), *orders], {}).ground_station
    assert [station.port for station in settings.stations] == [14550, 5760]
    assert (settings.cot[0].host, settings.may_order, len(settings.key)) == ("a", True, 32)
    assert parse_gateway([], {}).ground_station == NO_STATIONS


def test_a_gateway_may_have_no_internet_while_nobody_asks_over_http():
    assert parse_gateway(["--silence", "5"], {}).silence_s is None
    assert parse_gateway(["--internet", "http"], {}).silence_s == 60.0
    assert parse_gateway(["--internet", "http", "--silence", "5"], {}).silence_s == 5.0


def test_a_node_gets_the_fence_in_its_file(tmp_path, capsys):
    path = tmp_path / "yard.yaml"
    path.write_text("areas: [{name: yard, center: [0, 0], radius: 9}]", "utf-8")
    fence = parse_router(["--id", "3", "--fence", str(path)], {}).flight.fence
    assert fence.why_not((10.0, 0.0, 0.0)) == "outside fence yard"
    path.write_text("areas: []", "utf-8")
    with pytest.raises(SystemExit):
        parse_gateway(["--fence", str(path)], {})
    assert f"--fence {path}: 0 areas" in capsys.readouterr().err
