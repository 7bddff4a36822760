"""Everybody's tracks, alerts and access points on the Earth: GeoJSON (RFC 7946) and KML 2.2."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

import msgspec
import numpy as np

from command_post.exports.material import Floats, Kind, Material, Stance, geodetic, iso
from command_post.rehearsing.picture import COLOURS
from command_post.review.timeline import Mark
from shared.geodesy import Geodetic, Origin
from shared.messages import NodeId
from shared.units import NS_PER_S

KML = "http://www.opengis.net/kml/2.2"
GOOGLE = "http://www.google.com/kml/ext/2.2"
LEAST_S = 1.0
"""Moments of a track are so far apart at least."""


class _Line(NamedTuple):
    responder_id: NodeId
    kind: Kind
    times_ns: list[int]
    places: Floats


class _Pin(NamedTuple):
    """Something that stands somewhere, or happened there: ``until_ns`` if that is over."""

    kind: str
    name: str
    words: str
    place: Geodetic
    since_ns: int
    until_ns: int | None


def geojson_of(material: Material, origin: Origin) -> bytes:
    """Return tracks as lines (``times`` in UTC, one for each place), the rest as points."""
    features = [
        _feature(
            "LineString" if len(line.times_ns) > 1 else "Point",
            _coordinates(line.places) if len(line.times_ns) > 1 else _coordinates(line.places)[0],
            {"kind": "track", "of": line.responder_id, "track": line.kind,
             "times": [iso(each) for each in line.times_ns]},
        )
        for line in _lines(material, origin)
    ]  # fmt: skip
    features += [
        _feature(
            "Point",
            _coordinates(np.array([pin.place]))[0],
            {"kind": pin.kind, "of": pin.name, "words": pin.words, "since": iso(pin.since_ns),
             "until": None if pin.until_ns is None else iso(pin.until_ns)},
        )
        for pin in _pins(material, origin)
    ]  # fmt: skip
    return msgspec.json.encode({"type": "FeatureCollection", "features": features})


def kml_of(material: Material, origin: Origin) -> bytes:
    """Return tracks as ``gx:Track``, the rest as points with a time span.

    Heights are above the WGS 84 ellipsoid and nothing is drawn at them: a viewer would take them
    for heights above the sea.
    """
    root = Element("kml", {"xmlns": KML, "xmlns:gx": GOOGLE})
    document = SubElement(root, "Document")
    _told(document, "name", f"{material.settings.incident}, {iso(material.timeline.begin_ns)}")
    names = sorted({each.responder_id for each in material.stances})
    colours = dict(zip(names, cycle(COLOURS), strict=False))
    tracks = SubElement(document, "Folder")
    _told(tracks, "name", "Tracks")
    for line in _lines(material, origin):
        _kml_track(tracks, line, colours[line.responder_id])
    happened = SubElement(document, "Folder")
    _told(happened, "name", "Alerts, orders and access points")
    for pin in _pins(material, origin):
        _kml_pin(happened, pin)
    content: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return content


def _lines(material: Material, origin: Origin) -> Iterator[_Line]:
    for (name, kind), stances in material.tracks.items():
        kept = _thinned(stances)
        yield _Line(name, kind, [each.time_ns for each in kept], geodetic(kept, origin))


def _thinned(stances: list[Stance]) -> list[Stance]:
    kept = stances[:1]
    for each in stances[1:]:
        if each.time_ns - kept[-1].time_ns >= LEAST_S * NS_PER_S or each is stances[-1]:
            kept.append(each)
    return kept


def _pins(material: Material, origin: Origin) -> Iterator[_Pin]:
    for name, dap in material.daps.items():
        at = dap.position
        place = origin.geodetic(at.north_m, at.east_m, at.down_m)
        by = f"set down by {dap.installer_id}" if dap.installer_id else "at a known point"
        yield _Pin("access_point", name, by, place, dap.installed_ns, None)
    for mark in material.timeline.marks:
        time_ns = material.timeline.begin_ns + round(mark.at_s * NS_PER_S)
        there = material.where(mark.node_id, time_ns)
        if there is not None:
            place = origin.geodetic(*there.place_m)
            until_ns = _over_ns(mark, material.timeline.begin_ns)
            yield _Pin(mark.kind, mark.node_id, mark.words, place, time_ns, until_ns)


def _over_ns(mark: Mark, begin_ns: int) -> int | None:
    resolved = [step.at_s for step in mark.steps if step.stage == "resolved"]
    return begin_ns + round(resolved[-1] * NS_PER_S) if resolved else None


def _coordinates(places: Floats) -> list[list[float]]:
    """Return places (n, 3: latitude, longitude, height) as GeoJSON has them."""
    return [
        [round(longitude, 8), round(latitude, 8), round(height, 2)]
        for latitude, longitude, height in places.tolist()
    ]


def _feature(geometry: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": properties,
    }


def _kml_track(folder: Element, line: _Line, colour: str) -> None:
    placemark = SubElement(folder, "Placemark")
    smoothed = line.kind == "afterwards"
    _told(placemark, "name", f"{line.responder_id} afterwards" if smoothed else line.responder_id)
    style = SubElement(SubElement(placemark, "Style"), "LineStyle")
    red, green, blue = (colour[at : at + 2] for at in (1, 3, 5))
    _told(style, "color", f"{'99' if smoothed else 'ff'}{blue}{green}{red}")
    _told(style, "width", "2" if smoothed else "4")
    track = SubElement(placemark, "gx:Track")
    _told(track, "altitudeMode", "clampToGround")
    for time_ns in line.times_ns:
        _told(track, "when", iso(time_ns))
    for longitude, latitude, height in _coordinates(line.places):
        _told(track, "gx:coord", f"{longitude} {latitude} {height}")


def _kml_pin(folder: Element, pin: _Pin) -> None:
    placemark = SubElement(folder, "Placemark")
    _told(placemark, "name", f"{pin.kind.replace('_', ' ')}: {pin.name}")
    _told(placemark, "description", pin.words)
    span = SubElement(placemark, "TimeSpan")
    _told(span, "begin", iso(pin.since_ns))
    if pin.until_ns is not None:
        _told(span, "end", iso(pin.until_ns))
    latitude, longitude, height = pin.place
    point = SubElement(placemark, "Point")
    _told(point, "coordinates", f"{longitude:.8f},{latitude:.8f},{height:.2f}")


def _told(parent: Element, tag: str, text: str) -> None:
    """Add an element with words, without what XML cannot have."""
    told = "".join(each for each in text if each.isprintable())
    SubElement(parent, tag).text = told
