"""A map from a file or an address: what the page gets, and how bad ones are refused."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.testclient import TestClient

from drone_mesh.console import tiles as tiles_module
from drone_mesh.console.tiles import open_tiles
from drone_mesh.errors import ConfigurationError

PNG = b"\x89PNG\r\n\x1a\n north-west"
ABOUT = {"attribution": '&copy; <a href="http://a">Some One</a>', "bounds": "5.1,52,5.2,52.1"}
TEMPLATE = "https://{s}.tiles.example.org:8443/{z}/{x}/{y}.png?key=1"


@pytest.fixture(autouse=True)
def leaflet(tmp_path, monkeypatch):
    """Some library: these tests run no browser."""
    folder = tmp_path / "leaflet"
    folder.mkdir()
    (folder / "leaflet-src.esm.js").write_text("export {};")
    monkeypatch.setattr(tiles_module, "LEAFLET", folder)
    return folder


def mbtiles(path: Path, tile: object = PNG, **metadata: str) -> str:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name text, value text)")
        file.executemany("INSERT INTO metadata VALUES (?, ?)", metadata.items())
        columns = "zoom_level integer, tile_column integer, tile_row integer, tile_data blob"
        file.execute(f"CREATE TABLE tiles ({columns})")
        if tile is not None:  # the row counts from the south: this is the north-west one
            file.execute("INSERT INTO tiles VALUES (2, 0, 3, ?)", [tile])
    file.close()
    return str(path)


def refusal(given: object) -> str:
    with pytest.raises(ConfigurationError) as caught:
        open_tiles(str(given))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_tiles_of_a_file_are_served_where_the_page_asks_for_them(tmp_path):
    tiles = open_tiles(mbtiles(tmp_path / "field.mbtiles", **ABOUT))
    offer = tiles.for_page()
    assert (offer["url"], offer["min_zoom"], offer["max_zoom"]) == ("/tiles/{z}/{x}/{y}", 2, 2)
    assert offer["credit"] == "© Some One"
    assert tiles.image_sources == "'self' data:"
    with TestClient(Starlette(routes=tiles.routes)) as client:
        found = client.get("/tiles/2/0/0")
        assert (found.content, found.headers["content-type"]) == (PNG, "image/png")
        for elsewhere in ("2/0/3", "3/0/0", "2/4/0", "60/0/0", f"2/{'9' * 5000}/0", "2/x/0"):
            assert client.get(f"/tiles/{elsewhere}").status_code == 204
        assert client.get("/leaflet/leaflet-src.esm.js").status_code == 200


def test_an_mbtiles_file_says_where_its_map_is(tmp_path):
    assert open_tiles(mbtiles(tmp_path / "a.mbtiles", **ABOUT)).offer.bounds == (5.1, 52, 5.2, 52.1)
    for number, bounds in enumerate(
        ("x", "-1e999,-90,1e999,90", "nan,1,2,3", "0,1_0,20,30", "0,1,2", "0,-91,1,0", "3,1,2,2")
    ):
        path = tmp_path / f"{number}.mbtiles"
        assert open_tiles(mbtiles(path, bounds=bounds)).offer.bounds == ()


def test_the_page_may_load_pictures_from_the_server_of_an_address_and_from_no_other():
    tiles = open_tiles(f"{TEMPLATE}#© Some One")
    assert (tiles.offer.url, tiles.offer.credit) == (TEMPLATE, "© Some One")
    assert tiles.image_sources == "'self' data: https://*.tiles.example.org:8443"
    assert len(tiles.routes) == 1
    assert open_tiles(TEMPLATE).offer.credit == "tiles.example.org:8443"


@pytest.mark.parametrize(
    "given",
    [
        "https://a.org/{z}/{x}.png",
        "ftp://a.org/{z}/{x}/{y}",
        "https://a.org; script-src */{z}/{x}/{y}",
        "https://user@a.org/{z}/{x}/{y}",
    ],
)
def test_a_bad_address_is_refused(given):
    assert refusal(given).startswith("invalid address")


def test_a_bad_file_is_refused_in_one_line(tmp_path):
    (tmp_path / "text.mbtiles").write_text("no database" * 100)
    assert "text.mbtiles: not an MBTiles file: file is not a" in refusal(tmp_path / "text.mbtiles")
    assert refusal(tmp_path / "none.mbtiles").endswith("none.mbtiles: No such file or directory")
    assert "expected an .mbtiles file" in refusal(tmp_path / "map.tif")
    assert "has no tiles" in refusal(mbtiles(tmp_path / "empty.mbtiles", tile=None))
    vectors = mbtiles(tmp_path / "vectors.mbtiles", tile=b"\x1f\x8b...")
    assert "the page draws no vector tiles" in refusal(vectors)


def test_a_console_without_the_library_says_how_to_get_it(leaflet):
    (leaflet / "leaflet-src.esm.js").unlink()
    assert "scripts/map_library of the checkout fetches it" in refusal(TEMPLATE)


@pytest.mark.parametrize("tile", ["text", 10**9, 1.5, PNG + bytes(4_000_000)])
def test_where_an_mbtiles_file_has_something_else_than_a_picture_the_map_ends(tmp_path, tile):
    path = Path(mbtiles(tmp_path / "a.mbtiles", tile))
    assert "has no tiles" in refusal(path)
    with sqlite3.connect(path) as file:
        file.execute("INSERT INTO tiles VALUES (2, 1, 3, ?)", [PNG])
        file.execute("INSERT INTO tiles VALUES (2, 2, 3, NULL)")
    file.close()
    with TestClient(Starlette(routes=open_tiles(str(path)).routes)) as client:
        found = [client.get(f"/tiles/2/{x}/0").status_code for x in range(3)]
    assert found == [204, 200, 204]


def test_where_an_mbtiles_file_is_damaged_the_map_ends(tmp_path):
    path = Path(mbtiles(tmp_path / "a.mbtiles"))
    with sqlite3.connect(path) as file:
        file.execute("CREATE INDEX i ON tiles (zoom_level, tile_column, tile_row)")
        rows = [(3, x, 7, PNG + bytes([x]) * 3000) for x in range(8)]
        file.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    file.close()
    content = bytearray(path.read_bytes())
    page = content.index(b"\x05" * 3000) // 4096 * 4096
    content[page : page + 4096] = bytes(4096)
    path.write_bytes(content)
    with TestClient(Starlette(routes=open_tiles(str(path)).routes)) as client:
        found = [client.get(f"/tiles/3/{x}/0").status_code for x in range(8)]
    assert found == [200, 200, 200, 200, 200, 204, 200, 200]
    content[100:8192] = b"\xff" * 8092
    path.write_bytes(content)
    assert refusal(path).startswith(f"{path}: not an MBTiles file: ")


def test_a_damaged_schema_which_sqlite_quotes_is_refused_in_one_line(tmp_path):
    path = Path(mbtiles(tmp_path / "a.mbtiles"))
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE", b"CREATE \xffABLE"))
    assert refusal(path) == f"{path}: not an MBTiles file: damaged"


@pytest.mark.parametrize("zoom", ["'x'", "-1", "1e9"])
def test_zoom_levels_that_are_none_are_refused(tmp_path, zoom):
    path = Path(mbtiles(tmp_path / "a.mbtiles"))
    with sqlite3.connect(path) as file:
        file.execute(f"UPDATE tiles SET zoom_level = {zoom}")
    file.close()
    if zoom == "1e9":
        assert open_tiles(str(path)).offer.max_zoom == 22
    else:
        assert "zoom levels" in refusal(path)


def test_a_view_whose_query_never_ends_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(tiles_module, "MOST_QUERY_S", 0.05)
    path = tmp_path / "a.mbtiles"
    endless = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT k FROM n"
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name text, value text)")
        columns = "k AS zoom_level, k AS tile_column, k AS tile_row, k AS tile_data"
        file.execute(f"CREATE VIEW tiles AS SELECT {columns} FROM ({endless})")
    file.close()
    assert refusal(path) == f"{path}: not an MBTiles file: interrupted"


def test_a_credit_is_short_whatever_a_file_says(tmp_path):
    path = mbtiles(tmp_path / "a.mbtiles", attribution="<" * 900_000)
    assert open_tiles(path).offer.credit == "<" * 200
