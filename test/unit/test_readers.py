"""Every reader of users' files: the table of CONTRIBUTING.md, and damaged files."""

from __future__ import annotations

import ast
import gzip
import json
import random
import re
import sqlite3
from pathlib import Path
from typing import Callable, Iterator

import pytest

from drone_mesh.air.obstacle_file import read_obstacles
from drone_mesh.communication.seals.keys import KEY_BYTES, read_key_file
from drone_mesh.configuration import load_configuration
from drone_mesh.console import tiles
from drone_mesh.drone.geodesy import Origin
from drone_mesh.earth_files import read_placemarks
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.fence_file import read_fence
from drone_mesh.formations.layouts import Layouts
from drone_mesh.formations.mission_files import read_mission_file
from drone_mesh.formations.missions import Mission, read_missions
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.places import rows_of_file
from drone_mesh.mobility import Mobility
from drone_mesh.mobility.settings import check
from drone_mesh.mobility.trace_files import read_trace
from drone_mesh.secret_file import read_secret
from drone_mesh.yaml_file import read_text

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "drone_mesh"
DAMAGED = 60  # files of each seed; many more were tried when this was written
ORIGIN = Origin(52.0907, 5.1214, 3.0)

PARSERS = re.compile(  # calls that read the content of a file, or what others sent
    r"json\.loads?|csv\.(reader|DictReader)|ElementTree\.fromstring|gzip\.open|sqlite3\.connect|"
    r"rosbag\.Bag|yaml\.\w*load|read_(mapping|mapping_text|text)"
)
OTHERS = {  # modules that parse no file of a user, and what it is instead
    "internet/mqtt_internet": "MQTT",
    "lab/plan": "its own memory",
    "lab/show": "its own memory",
    "lab/worker": "its own memory",
    "nrf24/emulator/links": "a file of this package",
    "console/history": "its own memory",
    "console/memory": "its own file",
    "ros/services/standing_layouts": "its own parameter",
    "users/local_client": "a local socket",
    "users/local_socket": "a local socket",
    "web/json_client": "HTTP",
}


def called(call: ast.Call) -> str:
    """The name of the function, such as json.loads."""
    function = call.func
    if isinstance(function, ast.Attribute):
        owner = function.value.id if isinstance(function.value, ast.Name) else ""
        return f"{owner}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def parsing_modules() -> Iterator[str]:
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text("utf-8")
        nodes = ast.walk(ast.parse(text)) if PARSERS.search(text) else ()
        if any(PARSERS.fullmatch(called(node)) for node in nodes if isinstance(node, ast.Call)):
            yield path.relative_to(PACKAGE).with_suffix("").as_posix()


def test_the_table_of_readers_is_complete():
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    section = text[text.index("## Add a reader of files") :]
    rows = re.findall(r"^\| (`[^|]*`) \|", section, re.MULTILINE)
    listed = {name for row in rows for name in re.findall(r"`(\S+)\.py`", row)}
    found = set(parsing_modules())
    assert found >= OTHERS.keys()
    assert found - OTHERS.keys() - listed == set(), "these are missing in the table"
    assert [name for name in listed if not (PACKAGE / f"{name}.py").exists()] == []


def earth(path: Path) -> object:
    found = read_placemarks(read_text(path), str(path), ORIGIN)
    return found.goals({n: place for n, (_drone, place) in enumerate(found.points)})


def drawn(path: Path) -> object:
    try:
        return Mission.drawn(read_mission_file(path, ORIGIN), None, 5.0, True).pilot()
    except GoalRefused as error:  # too fast, say
        raise ConfigurationError(str(error)) from error


def trace(path: Path) -> object:
    return check(Mobility("trace", knots=read_trace(path)))


def mbtiles(folder: Path) -> bytes:
    path = folder / "seed.mbtiles"
    with sqlite3.connect(path) as file:
        file.execute("create table metadata (name text, value text)")
        file.execute("create table tiles (zoom_level, tile_column, tile_row, tile_data)")
        file.execute("insert into metadata values ('format', 'png'), ('bounds', '5,52,6,53')")
        file.execute("insert into tiles values (0, 0, 0, ?)", (b"\x89PNG\r\n\x1a\n" + bytes(90),))
    file.close()
    return path.read_bytes()


GEOJSON = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"drone": 3, "height": 2, "id": 4},
            "geometry": {
                "type": "GeometryCollection",
                "geometries": [
                    {"type": "Point", "coordinates": [5.1214, 52.0907, 3]},
                    {"type": "LineString", "coordinates": [[5.1214, 52.0907], [5.1215, 52.0907]]},
                ],
            },
        }
    ],
}
KML = (
    '<?xml version="1.0"?><kml xmlns:gx="http://www.google.com/kml/ext/2.2"><Placemark><name>0 '
    "</name><Point><altitudeMode>absolute</altitudeMode><coordinates>5.1234,52.0907,3</coordinates>"
    "</Point></Placemark><Placemark><LineString><coordinates>5.1214,52.0907 5.1215,52.0907,2"
    "</coordinates></LineString><gx:Track><when>2026-05-01</when><gx:coord>5.1214 52.0907 3"
    "</gx:coord><gx:coord>5.1215 52.0907 3</gx:coord></gx:Track></Placemark></kml>"
)
ITEM = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 52.09, 5.12, 9]}
SURVEY = {"type": "ComplexItem", "TransectStyleComplexItem": {"Items": [ITEM, ITEM]}}
HOME = [52.09, 5.12, None]
SURVEY_PLAN = {
    "fileType": "Plan",
    "mission": {"items": [ITEM, SURVEY], "plannedHomePosition": HOME, "hoverSpeed": 5},
}
WPL = (
    "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t52.09\t5.12\t3\t1\n"
    "1 0 3 22 0 0 0 0 0 0 9 1\n2 0 3 16 0 0 0 nan 52.09 5.12 9 1\n3 0 2 20 0 0 0 0 0 0 0 1\n"
)
NS2 = (
    "set god_ [God instance]\n$node_(0) set X_ 0.1\n"
    '$ns_ at 1.0 "$node_(0) setdest 0.3 0.0 0.1" # fly\n$ns_ at 1.0 "$node_(0) set X_ 9"\n'
)
RECORD = {"uptime_s": 1.5, "nodes": [{"id": 3, "place": [1.0, 2.0, 3.0]}], "events": []}
CSV = '"t", id,x,y,z\n0,3,1,2,3\n1.5,3,1e3,-2,3\n'
BOXES = "boxes:\n- {center: [1, 2, 3.0], size: [1, 1, 1], yaw_deg: 30, material: brick}\n"
FENCE = "areas:\n- {name: a, polygon: [[0, 0], [9, 0], [9.5, 9]], max_height: 5, min_height: -1}\n"
CORNERS = [[52.09, 5.12], [52.09, 5.13], [52.1, 5.13]]
AREAS = {
    "type": "Feature",
    "properties": {"name": "a", "inclusion": False, "max_height": 5},
    "geometry": {"type": "Polygon", "coordinates": [[[y, x] for x, y in CORNERS]]},
}
PLAN = {
    "fileType": "Plan",
    "geoFence": {
        "version": 2,
        "polygons": [{"inclusion": True, "polygon": CORNERS}],
        "circles": [{"inclusion": True, "circle": {"center": CORNERS[0], "radius": 9.5}}],
    },
    "rallyPoints": {"points": [[52.093, 5.128, 10.0]], "version": 2},
}
MISSIONS = "missions:\n- {drones: [1, 2], waypoints: [[0, 1], [2, 3]], height: 3, loop: true}\n"
EXPERIMENT = (
    "name: yard\nseeds: 2\nbase:\n  layout: {kind: grid, drones: 4}\nsweep: {range_m: [9]}\n"
)

READERS: list[tuple[str, Callable[[Path], object], str]] = [
    ("a.geojson", earth, json.dumps(GEOJSON)),
    ("a.kml", earth, KML),
    ("layout.yaml", Layouts.load, "cases:\n  5:\n    1: [0, 1.5, 0]\n    10: [0, 1.0e+1, 0]\n"),
    ("missions.yaml", read_missions, MISSIONS),
    ("a.plan", drawn, json.dumps(SURVEY_PLAN)),
    ("a.waypoints", drawn, WPL),
    ("boxes.yaml", read_obstacles, BOXES),
    ("fence.yaml", lambda path: read_fence(path, ORIGIN), FENCE),
    ("fence.geojson", lambda path: read_fence(path, ORIGIN), json.dumps(AREAS)),
    ("fence.plan", lambda path: read_fence(path, ORIGIN), json.dumps(PLAN)),
    ("factory.yaml", load_configuration, "routers: 3\nspacing: 1.5\nrouting: beacon\n"),
    ("trial.yaml", load_experiment, EXPERIMENT),
    ("yard.csv", rows_of_file, 'id,x,"y",role\n0,0,0,gateway\n3,5,0,router\n'),
    ("flight.csv", trace, CSV),
    ("flight.csv.gz", trace, CSV),
    ("moves.tcl", trace, NS2),
    ("moves.bonn", trace, "#3D\n0 0 0 2 10 0 20 2 20 30 40 2\n"),
    ("flight.jsonl", trace, f"{json.dumps(RECORD)}\n" * 2),
    ("mesh.key", read_key_file, f"drone_mesh mesh key\n{KEY_BYTES * '5a'}\n"),
    ("token", lambda path: read_secret(path, "token"), "0123456789abcdef\n"),
    ("map.mbtiles", lambda path: tiles.open_tiles(str(path)), ""),
]

HARMFUL = [  # what other programs write, and what readers took amiss
    b"\xef\xbb\xbf", b"010", b"1:30", b"1e308", b"-1e999", b"nan", b"0x1", b"null", b"{}", b"[]",
    b'""', b"\xff", b"\x00", b"\r", b"'", b'"', b"#", b"&a;", b"<!--", b"[" * 300, b"-", b"\n",
]  # fmt: skip


def damaged(seed: bytes, rng: random.Random) -> bytes:
    content = bytearray(seed)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(content) + 1)
        kind = rng.randrange(6)
        if kind == 0:  # a value becomes another one
            values = list(re.finditer(rb"[0-9.]+|\w+|[\"'{}\[\]<>,:]", content))
            begin, end = rng.choice(values).span() if values else (at, at)
            content[begin:end] = rng.choice(HARMFUL)
        elif kind == 1:
            content[at:at] = rng.choice(HARMFUL)
        elif kind == 2:
            del content[at : at + rng.choice((1, 5, 50))]
        elif kind == 3:
            content[at : at + 1] = bytes([rng.randrange(256)])
        elif kind == 4:
            content[at:at] = content[at : at + 40]
        else:
            content[at : at + 20] = bytes(len(content[at : at + 20]))
    return bytes(content)


@pytest.fixture(autouse=True)
def leaflet(tmp_path, monkeypatch):
    """Some library, which a map needs, but not to be read."""
    (tmp_path / "leaflet-src.esm.js").write_text("export {};")
    monkeypatch.setattr(tiles, "LEAFLET", tmp_path)


@pytest.mark.parametrize(("name", "read", "text"), READERS, ids=[name for name, *_ in READERS])
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path, name, read, text):
    seed = text.encode() if text else mbtiles(tmp_path)
    path = tmp_path / name
    good = [seed] if name.startswith("map") else [seed, b"\xef\xbb\xbf" + seed]
    for number in range(-len(good), DAMAGED):
        content = good[number] if number < 0 else damaged(seed, random.Random(number))
        path.unlink(missing_ok=True)
        path.touch(0o600)
        path.write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
        if refusal := refused(read, path):
            assert number >= 0, f"{refusal}: a good file"
            assert "\n" not in refusal
            assert len(refusal) < 1000


def refused(read: Callable[[Path], object], path: Path) -> str:
    """Why; empty if it was read. Anything but one of our own errors fails the test."""
    try:
        read(path)
    except ConfigurationError as error:
        return str(error)
    return ""
