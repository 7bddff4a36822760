"""Cursor on Target, as TAK speaks it (pure): events written, and those that matter read.

Types and details are those that TAK clients draw and sound: a responder is friendly ground
(``a-f-G-U-C``), an access point a marker, an alarm the emergency of its responder, which a client
shows until it is cancelled. ``ce`` and ``le`` are told as the radius of 95 %, which is more than
the one standard deviation that some take them for: rather too wide than too sure.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, TypeAlias
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from shared.geodesy import Geodetic
from shared.units import NS_PER_S

RESPONDER = "a-f-G-U-C"
DAP = "b-m-p-s-p-loc"
ALARM = "b-a-o-tbl"
CANCEL = "b-a-o-can"
CHAT = "b-t-f"

RESPONDER_STALE_S = 15.0
DAP_STALE_S = 120.0
ALARM_STALE_S = 10.0
NOT_KNOWN_M = 9_999_999.0
"""What stands for an error nobody knows."""

LONGEST_EVENT_BYTES = 1 << 16
MOST_WORDS = 200
_EMERGENCIES = {"mayday": "911 Alert", "fall": "911 Alert", "motionless": "911 Alert"}

HeardKind: TypeAlias = Literal["marker", "message", "mayday", "cancel"]


class Shown(NamedTuple):
    """Something on a map: who, where, and how surely (95 %, m)."""

    uid: str
    callsign: str
    place: Geodetic
    circular_m: float
    vertical_m: float | None


class Heard(NamedTuple):
    """What somebody in another system says, and where, if that is a place."""

    kind: HeardKind
    uid: str
    callsign: str
    words: str
    place: Geodetic | None


def responder_event(shown: Shown, now_ns: int, course_deg: float | None, remarks: str) -> bytes:
    """Return where a responder is; ``course_deg`` is which way they face, from true north."""
    event = _event(shown, RESPONDER, now_ns, RESPONDER_STALE_S)
    detail = _detail(event)
    SubElement(detail, "contact", callsign=shown.callsign)
    SubElement(detail, "__group", name="Red", role="Team Member")
    SubElement(detail, "precisionlocation", geopointsrc="Clew", altsrc="Clew")
    if course_deg is not None:
        SubElement(detail, "track", course=f"{course_deg % 360.0:.1f}", speed="0.0")
    SubElement(detail, "remarks").text = _printable(remarks)
    return _bytes(event)


def dap_event(shown: Shown, now_ns: int, remarks: str) -> bytes:
    """Return where an access point stands."""
    event = _event(shown, DAP, now_ns, DAP_STALE_S)
    detail = _detail(event)
    SubElement(detail, "contact", callsign=shown.callsign)
    SubElement(detail, "remarks").text = _printable(remarks)
    return _bytes(event)


def alarm_event(shown: Shown, now_ns: int, kind: str, *, cancelled: bool = False) -> bytes:
    """Return that something is wrong with a responder, or no more."""
    raised = shown._replace(uid=f"{shown.uid}-9-1-1")
    event = _event(raised, CANCEL if cancelled else ALARM, now_ns, ALARM_STALE_S)
    detail = _detail(event)
    SubElement(detail, "link", uid=shown.uid, type=RESPONDER, relation="p-p")
    SubElement(detail, "contact", callsign=f"{shown.callsign}-Alert")
    if cancelled:
        emergency = SubElement(detail, "emergency", cancel="true")
    else:
        emergency = SubElement(detail, "emergency", type=_EMERGENCIES.get(kind, "Custom Alert"))
    emergency.text = shown.callsign
    return _bytes(event)


def read_event(data: bytes) -> Heard | None:
    """Return what an event says, if it is one that matters here; ``None`` for any other bytes."""
    if len(data) > LONGEST_EVENT_BYTES:
        return None
    try:
        event = fromstring(data)
    except (ParseError, DefusedXmlException, ValueError):
        return None
    kind = _kind(event)
    uid = event.get("uid", "")[:MOST_WORDS]
    if event.tag != "event" or kind is None or not uid:
        return None
    return Heard(kind, uid, _callsign(event), _words(event), _place(event))


def _event(shown: Shown, kind: str, now_ns: int, stale_s: float) -> Element:
    stale_ns = now_ns + round(stale_s * NS_PER_S)
    event = Element(
        "event", version="2.0", uid=shown.uid, type=kind, how="m-p",
        time=_time(now_ns), start=_time(now_ns), stale=_time(stale_ns),
    )  # fmt: skip
    SubElement(
        event, "point",
        lat=f"{shown.place.latitude_deg:.7f}", lon=f"{shown.place.longitude_deg:.7f}",
        hae=f"{shown.place.height_m:.2f}", ce=f"{shown.circular_m:.1f}",
        le=f"{NOT_KNOWN_M if shown.vertical_m is None else shown.vertical_m:.1f}",
    )  # fmt: skip
    return event


def _detail(event: Element) -> Element:
    return SubElement(event, "detail")


def _bytes(event: Element) -> bytes:
    return bytes(tostring(event, encoding="utf-8"))


def _time(time_ns: int) -> str:
    return f"{np.datetime_as_string(np.datetime64(time_ns, 'ns'), unit='ms')}Z"


def _printable(text: str) -> str:
    """Return ``text`` without what XML cannot hold."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _kind(event: Element) -> HeardKind | None:
    kind = event.get("type", "")
    if kind == CANCEL or event.find("detail/emergency[@cancel='true']") is not None:
        return "cancel"
    if kind.startswith("b-a-"):
        return "mayday"
    if kind == CHAT:
        return "message"
    return "marker" if kind.startswith("b-m-p") else None


def _callsign(event: Element) -> str:
    named = (("detail/__chat", "senderCallsign"), ("detail/contact", "callsign"))
    for path, attribute in named:
        found = event.find(path)
        callsign = None if found is None else found.get(attribute)
        if callsign:
            return callsign[:MOST_WORDS]
    return event.get("uid", "")[:MOST_WORDS]


def _words(event: Element) -> str:
    remarks = event.find("detail/remarks")
    return " ".join((remarks.text or "").split())[:MOST_WORDS] if remarks is not None else ""


def _place(event: Element) -> Geodetic | None:
    point = event.find("point")
    if point is None:
        return None
    try:
        latitude, longitude, height = (
            float(point.get(name, "nan")) for name in ("lat", "lon", "hae")
        )
    except ValueError:
        return None
    place = Geodetic(latitude, longitude, height)
    usable = all(map(math.isfinite, place)) and abs(place.latitude_deg) <= 90.0
    nowhere = place.latitude_deg == place.longitude_deg == 0.0
    in_range = abs(place.longitude_deg) <= 180.0 and abs(place.height_m) < NOT_KNOWN_M
    return place if usable and in_range and not nowhere else None
