"""KML 2.2 (OGC 07-147r2): placemarks with points and lines."""

from __future__ import annotations

from typing import Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from drone_mesh.arguments import finite
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.earth_files.placemarks import Placemarks, drone_named, on_earth, place_on
from drone_mesh.errors import ConfigurationError

_NAMESPACE = "http://www.opengis.net/kml/2.2"


def read_kml(text: str, origin: Origin) -> Placemarks:
    """The points, lines and recorded tracks of all placemarks; "drone 3" names the drone.

    Heights as their `altitudeMode` says: above the origin, above sea level, or (as without it) 0.
    Areas are left out. Raises ConfigurationError.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:  # entities may expand without bounds
        raise ConfigurationError("declares a document type or entities, which KML does not need")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise ConfigurationError(f"not XML: {error}") from error
    if _tag(root) != "kml":
        raise ConfigurationError(f"not KML: its first element is {_tag(root)!r}")
    found = Placemarks()
    for mark in root.iter():
        if _tag(mark) != "Placemark":
            continue
        name = next((element.text for element in mark if _tag(element) == "name"), None)
        try:
            drone = drone_named(name)
            for shape in mark.iter():
                tag = _tag(shape)
                if tag == "Placemark" and shape is not mark:  # n of them have n * n / 2 shapes
                    raise ConfigurationError("another placemark inside it")
                if tag == "Point":
                    places = _places(shape, origin)
                    if len(places) != 1:
                        raise ConfigurationError(f"a point with {len(places)} places")
                    found.add_point(drone, places[0])
                elif tag == "LineString":
                    found.add_path(drone, _places(shape, origin))
                elif tag == "Track":  # of Google: gx:coord has blanks between its numbers
                    coords = (one.text or "" for one in shape if _tag(one) == "coord")
                    positions = (",".join(text.split()) for text in coords)
                    found.add_path(drone, _places(shape, origin, positions))
        except ConfigurationError as error:
            raise ConfigurationError(f"placemark {(name or '')[:40]!r}: {error}") from error
    return found


def kml_of(found: Placemarks, origin: Origin) -> str:
    """One placemark for each place and each track; heights are absolute."""
    root = Element("kml", xmlns=_NAMESPACE)
    document = SubElement(root, "Document")
    for point in found.points:
        _write(document, point.drone, "Point", [point.place], origin)
    for path in found.paths:
        _write(document, path.drone, "LineString", path.places, origin)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _write(
    document: Element, drone: int | None, kind: str, places: Sequence[Location], origin: Origin
) -> None:
    mark = SubElement(document, "Placemark")
    mark.tail = "\n"
    SubElement(mark, "name").text = f"drone {drone}"
    shape = SubElement(mark, kind)
    SubElement(shape, "altitudeMode").text = "absolute"
    SubElement(shape, "coordinates").text = " ".join(
        ",".join(map(str, on_earth(origin, place))) for place in places
    )


def _tag(element: Element) -> str:
    """The name of an element without its namespace, of which programs write several."""
    return str(element.tag).rpartition("}")[2]


def _text(element: Element, tag: str) -> str:
    return next((one.text or "" for one in element if _tag(one) == tag), "").strip()


def _places(
    shape: Element, origin: Origin, positions: Iterable[str] | None = None
) -> list[Location]:
    """The places of a shape; `positions` replaces its coordinates."""
    mode = _text(shape, "altitudeMode")
    places = []
    for position in _text(shape, "coordinates").split() if positions is None else positions:
        try:
            longitude, latitude, *rest = map(finite, position.split(","))
        except ValueError:
            raise ConfigurationError(
                f"{position[:40]!r} is not longitude,latitude,height"
            ) from None
        height = rest[0] if rest else 0.0
        if mode == "absolute":
            height -= origin.altitude_m
        elif mode != "relativeToGround":
            height = 0.0
        places.append(place_on(origin, latitude, longitude, height))
    return places
