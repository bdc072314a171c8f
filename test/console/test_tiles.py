"""The map under the drones: it follows the canvas, and nothing is fetched unless it is wanted."""

from __future__ import annotations

import math
import sqlite3
import struct
import threading
import zlib
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Iterator

import pytest
from conftest import Visit
from test_axe import check
from test_page import PLACES, on_screen

ZOOM, COLUMN, ROW = 18, 134801, 86301  # of the tile whose north-west corner is the origin
SCREEN = {"width": 1400, "height": 880}


def corner(column: int, row: int) -> tuple[float, float]:
    """Latitude and longitude of the north-west corner of a tile of web maps, in degrees."""
    north = math.pi * (1 - 2 * row / 2**ZOOM)
    return math.degrees(math.atan(math.sinh(north))), 360 * column / 2**ZOOM - 180


ORIGIN = ",".join(f"{value:.9f}" for value in (*corner(COLUMN, ROW), 3.0))


def picture(grey: int) -> bytes:
    """A PNG of 256 x 256 pixels of this grey."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    rows = b"".join(b"\0" + bytes([grey]) * 256 for _ in range(256))
    head = struct.pack(">IIBBBBB", 256, 256, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


@pytest.fixture(scope="module")
def tile_file(tmp_path_factory) -> str:
    """An MBTiles file of 8 x 8 tiles around the origin."""
    path: Path = tmp_path_factory.mktemp("map") / "field.mbtiles"
    south, west = corner(COLUMN - 4, ROW + 4)
    north, east = corner(COLUMN + 4, ROW - 4)
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name text, value text)")
        bounds = f"{west},{south},{east},{north}"
        file.execute("INSERT INTO metadata VALUES ('bounds', ?)", [bounds])
        file.execute("INSERT INTO metadata VALUES ('attribution', '&copy; <b>A test</b>')")
        columns = "zoom_level integer, tile_column integer, tile_row integer, tile_data blob"
        file.execute(f"CREATE TABLE tiles ({columns})")
        for x in range(COLUMN - 4, COLUMN + 4):
            for y in range(ROW - 4, ROW + 4):
                row = (ZOOM, x, 2**ZOOM - 1 - y, picture(200 if (x + y) % 2 else 160))
                file.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", row)
    file.close()
    return str(path)


def drawn_tiles(page: Visit) -> dict[str, dict[str, float]]:
    """Where each tile is on the page, by its address, if its picture has come."""
    boxes: dict[str, dict[str, float]] = page.page.evaluate(
        """() => Object.fromEntries([...document.querySelectorAll("#tiles img")]
          .filter((img) => img.complete && img.naturalWidth === 256)
          .map((img) => [new URL(img.src).pathname, img.getBoundingClientRect().toJSON()]))"""
    )
    return boxes


def lies_on_the_origin(page: Visit) -> bool:
    """Whether the corner of the tile is where the canvas draws x 0, y 0; two pixels of slack."""
    tile = drawn_tiles(page).get(f"/tiles/{ZOOM}/{COLUMN}/{ROW}")
    if tile is None:
        return False
    x, y = on_screen(page, 0.0, 0.0)
    return abs(tile["left"] - x) < 2 and abs(tile["top"] - y) < 2


def test_the_map_lies_under_the_drones_and_moves_with_them(start_console, visit, tile_file):
    page = visit(start_console("--origin", ORIGIN, "--tiles", tile_file).url)
    page.wait_for_drones(len(PLACES))
    page.wait_for("the map", lambda: lies_on_the_origin(page))
    assert page.page.inner_text("#map-credit") == "© A test"
    page.page.focus("#map")
    for key in ("ArrowLeft", "-", "ArrowUp", "+", "+"):
        page.page.keyboard.press(key)
        page.wait_for(f"the map after {key}", lambda: lies_on_the_origin(page))
    # The camera is linear in metres and the map is not: a tile away they agree all the same.
    latitude, longitude = corner(COLUMN + 1, ROW - 1)
    x, y = page.page.evaluate(
        """async ([origin, latitude, longitude]) =>
          (await import("/static/earth.js")).toFrame(origin, latitude, longitude)""",
        [[float(value) for value in ORIGIN.split(",")], latitude, longitude],
    )
    page.page.keyboard.press("f")
    for _ in range(8):
        page.page.keyboard.press("-")
    away = f"/tiles/{ZOOM}/{COLUMN + 1}/{ROW - 1}"
    page.wait_for("the next tile", lambda: lies_on_the_origin(page) and away in drawn_tiles(page))
    at_x, at_y = on_screen(page, x, y)
    tile = drawn_tiles(page)[away]
    assert (tile["left"], tile["top"]) == pytest.approx((at_x, at_y), abs=3)
    page.page.uncheck("#show-map")
    assert not page.page.is_visible("#tiles img")
    assert not page.page.is_visible("#map-credit")
    assert all(url.startswith(page.page.url) for url in page.requests if "data:" not in url)


@pytest.mark.parametrize("size", [(1400, 880), (390, 780)], ids=["desk", "phone"])
def test_axe_finds_no_violation_on_a_map(start_console, visit, tile_file, size):
    page = visit(
        start_console("--origin", ORIGIN, "--tiles", tile_file).url,
        viewport={"width": size[0], "height": size[1]},
    )
    page.wait_for_drones(len(PLACES))
    page.wait_for("the map", lambda: lies_on_the_origin(page))
    check(page, "a map")
    assert page.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    page.page.check("#degrees")
    page.page.focus("#map")
    page.page.keyboard.press("n")
    page.wait_for("degrees", lambda: "Latitude" in page.page.inner_text("#node-facts"))
    check(page, "degrees")
    if size[0] > 500:
        page.page.click("#files-button")
        check(page, "files for other programs")


@pytest.mark.parametrize("arguments", [(), ("--origin", ORIGIN)], ids=["nowhere", "on the earth"])
def test_without_tiles_there_is_the_grid_and_nothing_is_fetched(start_console, visit, arguments):
    page = visit(start_console(*arguments).url)
    page.wait_for_drones(len(PLACES))
    assert not page.page.is_visible("#show-map")
    assert [url for url in page.requests if "leaflet" in url or "/tiles/" in url] == []


def test_the_page_says_why_a_gateway_without_an_origin_has_no_map(start_console, visit, tile_file):
    page = visit(start_console("--real", "--tiles", tile_file).url)
    page.wait_for_drones(len(PLACES))
    page.page.wait_for_selector("#map-credit:text('the gateway does not know where it is')")
    check(page, "no origin")
    assert [url for url in page.requests if "leaflet" in url or "/tiles/" in url] == []


class TileServer(ThreadingHTTPServer):
    """Another server, with the same tile everywhere."""

    def __init__(self) -> None:
        self.referrers: set[str | None] = set()
        super().__init__(("127.0.0.1", 0), TileHandler)


class TileHandler(BaseHTTPRequestHandler):
    server: TileServer

    def do_GET(self) -> None:
        self.server.referrers.add(self.headers.get("Referer"))
        body = picture(180)
        self.send_response(200)
        self.send_header("Content-Type", "image/png")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_arguments: object) -> None:
        pass


@pytest.fixture
def other_server() -> Iterator[TileServer]:
    with TileServer() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_the_tiles_of_another_server_are_drawn_and_it_learns_who_asks(
    start_console, visit, other_server
):
    host = f"http://127.0.0.1:{other_server.server_port}"
    template = f"{host}/tiles/{{z}}/{{x}}/{{y}}#Some One"
    console = start_console("--origin", ORIGIN, "--tiles", template)
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    page.wait_for("tiles", lambda: len(drawn_tiles(page)) > 3)
    assert page.page.inner_text("#map-credit") == "Some One"
    assert other_server.referrers == {console.url}
    policy = page.page.request.get(console.url).headers["content-security-policy"]
    assert policy.endswith(f"img-src 'self' data: {host}")
