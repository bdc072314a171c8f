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


def mbtiles(path: Path, tile: bytes | None = PNG, **metadata: str) -> str:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name text, value text)")
        file.executemany("INSERT INTO metadata VALUES (?, ?)", metadata.items())
        columns = "zoom_level integer, tile_column integer, tile_row integer, tile_data blob"
        file.execute(f"CREATE TABLE tiles ({columns})")
        if tile:  # the row counts from the south: this is the north-west one
            file.execute("INSERT INTO tiles VALUES (2, 0, 3, ?)", [tile])
    file.close()
    return str(path)


def pmtiles(path: Path) -> str:
    from pmtiles.tile import Compression, TileType, zxy_to_tileid
    from pmtiles.writer import write

    with write(str(path)) as writer:
        writer.write_tile(zxy_to_tileid(2, 0, 0), PNG)
        header = {
            "tile_type": TileType.PNG,
            "tile_compression": Compression.NONE,
            **{
                f"{end}_{axis}_e7": 0 for end in ("min", "max", "center") for axis in ("lon", "lat")
            },
            "center_zoom": 2,
        }
        writer.finalize(header, {"attribution": ABOUT["attribution"]})
    return str(path)


def refusal(given: object) -> str:
    with pytest.raises(ConfigurationError) as caught:
        open_tiles(str(given))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", ["mbtiles", "pmtiles"])
def test_the_tiles_of_a_file_are_served_where_the_page_asks_for_them(tmp_path, kind):
    path = tmp_path / f"field.{kind}"
    tiles = open_tiles(mbtiles(path, **ABOUT) if kind == "mbtiles" else pmtiles(path))
    offer = tiles.for_page()
    assert (offer["url"], offer["min_zoom"], offer["max_zoom"]) == ("/tiles/{z}/{x}/{y}", 2, 2)
    assert offer["credit"] == "© Some One"
    assert tiles.image_sources == "'self' data:"
    with TestClient(Starlette(routes=tiles.routes)) as client:
        found = client.get("/tiles/2/0/0")
        assert (found.content, found.headers["content-type"]) == (PNG, "image/png")
        for elsewhere in ("2/0/3", "3/0/0", "2/4/0", "60/0/0"):
            assert client.get(f"/tiles/{elsewhere}").status_code == 204
        assert client.get("/leaflet/leaflet-src.esm.js").status_code == 200


def test_an_mbtiles_file_says_where_its_map_is(tmp_path):
    assert open_tiles(mbtiles(tmp_path / "a.mbtiles", **ABOUT)).offer.bounds == (5.1, 52, 5.2, 52.1)
    assert open_tiles(mbtiles(tmp_path / "b.mbtiles", bounds="x")).offer.bounds == ()


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
    (tmp_path / "text.pmtiles").write_text("no archive" * 100)
    (tmp_path / "empty.pmtiles").write_text("")
    (tmp_path / "short.pmtiles").write_bytes(
        Path(pmtiles(tmp_path / "a.pmtiles")).read_bytes()[:90]
    )
    assert "text.mbtiles: not an MBTiles file: file is not a" in refusal(tmp_path / "text.mbtiles")
    for name in ("text", "empty", "short"):
        path = tmp_path / f"{name}.pmtiles"
        assert refusal(path).startswith(f"{path}: not a PMTiles file of version 3: ")
    assert refusal(tmp_path / "none.mbtiles").endswith("none.mbtiles: No such file or directory")
    assert "expected an .mbtiles or .pmtiles file" in refusal(tmp_path / "map.tif")
    assert "has no tiles" in refusal(mbtiles(tmp_path / "empty.mbtiles", tile=None))
    vectors = mbtiles(tmp_path / "vectors.mbtiles", tile=b"\x1f\x8b...")
    assert "the page draws no vector tiles" in refusal(vectors)


def test_a_console_without_the_library_says_how_to_get_it(leaflet):
    (leaflet / "leaflet-src.esm.js").unlink()
    assert "scripts/map_library of the checkout fetches it" in refusal(TEMPLATE)
