"""A report of an incident, in one file that any browser shows and prints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

import msgspec
import numpy as np

from command_post.confidence import radii95_m
from command_post.exports.material import Material, Stance, iso
from command_post.exports.report_pictures import floor_map, floors_over_time, stays
from command_post.recorder.verification import Verification, verify_recording
from command_post.review.timeline import Mark
from shared.units import NS_PER_S

ORDERS = frozenset({"evacuate", "roll_call", "message", "withdraw"})
_STYLE = """
body{font:11pt/1.4 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#111}
h1{margin-bottom:0}h2{border-bottom:1px solid #999;break-after:avoid}
table{border-collapse:collapse;width:100%;font-size:10pt}
th,td{border:1px solid #bbb;padding:.2rem .4rem;text-align:left;vertical-align:top}
img{max-width:100%}figure{margin:1rem 0;break-inside:avoid}tr{break-inside:avoid}
.bad{color:#b00020;font-weight:600}code,pre{font-size:9pt;overflow-wrap:anywhere}
pre{white-space:pre-wrap}
"""


def report_of(material: Material, file: Path) -> bytes:
    """Return the report of a recording that was read from ``file``, which is read once more.

    Raises ``RecordingError`` if that cannot be.
    """
    verified = verify_recording(file)
    line = material.timeline
    end_ns = line.begin_ns + round(line.length_s * NS_PER_S)
    title = f"Incident {material.settings.incident}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>Recorded {iso(line.begin_ns)} to {iso(end_ns)} (UTC, the post's clock) by post "
        f"<b>{escape(material.settings.post_id)}</b>. All places are as the post held them to be; "
        "those of alerts as it did when they came.</p>",
        *_record(verified, material),
        "<h2>Where</h2>", *_maps(material),
        "<h2>Who</h2>", _people(material), _figure(floors_over_time(material), "Storeys over time"),
        "<h2>Alerts</h2>", _alerts(material),
        "<h2>Orders</h2>", _orders(material),
        "<h2>Gaps in the record</h2>", _gaps(material),
        "<h2>Evidence</h2>", *_evidence(verified, material),
    ]  # fmt: skip
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>'
    lines = [
        "<!doctype html>",
        f'<html lang="en"><head>{head}</head><body>',
        *parts,
        "</body></html>",
    ]
    return "\n".join([*lines, ""]).encode()


def _record(verified: Verification, material: Material) -> Iterator[str]:
    if verified.whole and not material.timeline.faults:
        yield "<p>The record is whole: nothing is missing, repeated or out of order.</p>"
    else:
        yield '<p class="bad">The record is not whole; see Evidence.</p>'


def _maps(material: Material) -> Iterator[str]:
    if not material.stances:
        yield "<p>Nobody was located.</p>"
        return
    for floor in material.floors:
        caption = f"Floor {floor.level}, at {-floor.down_m:.1f} m above the incident's origin"
        yield _figure(floor_map(material, floor.level), caption)


def _people(material: Material) -> str:
    rows = [
        _person(name, stances, material)
        for (name, kind), stances in material.tracks.items()
        if kind == "live"
    ]
    columns = ("Responder", "first", "last", "walked", "storeys", "give or take, median")
    return _table(columns, rows)


def _person(name: str, stances: Sequence[Stance], material: Material) -> list[str]:
    places_m = np.array([each.place_m for each in stances])
    walked_m = float(np.hypot(*np.diff(places_m[:, :2], axis=0).T).sum())
    on_floors: dict[int, float] = {}
    for level, from_ns, to_ns in stays(material, stances):
        on_floors[level] = on_floors.get(level, 0.0) + (to_ns - from_ns) / 60e9
    told = ", ".join(f"{level}: {minutes:.1f} min" for level, minutes in on_floors.items())
    radius_m = float(np.median([radii95_m(each.covariance_m2)[0] for each in stances]))
    times = [iso(each.time_ns) for each in (stances[0], stances[-1])]
    return [name, *times, f"{walked_m:.0f} m", told, f"{radius_m:.1f} m (95 %)"]


def _alerts(material: Material) -> str:
    marks = [each for each in material.timeline.marks if each.kind not in ORDERS]
    if not marks:
        return "<p>Nothing was alerted to.</p>"
    rows = [
        [_at(material, each.at_s), each.kind.replace("_", " "), each.node_id, each.words,
         _where(material, each), _steps(material, each)]
        for each in marks
    ]  # fmt: skip
    return _table(("When", "What", "Who", "In words", "Where", "What became of it"), rows)


def _orders(material: Material) -> str:
    marks = [each for each in material.timeline.marks if each.kind in ORDERS]
    if not marks:
        return "<p>Nothing was ordered.</p>"
    rows = [
        [_at(material, each.at_s), each.kind.replace("_", " "), each.node_id, each.words,
         _steps(material, each)]
        for each in marks
    ]  # fmt: skip
    return _table(("When", "Order", "By", "In words", "Answers"), rows)


def _where(material: Material, mark: Mark) -> str:
    time_ns = material.timeline.begin_ns + round(mark.at_s * NS_PER_S)
    there = material.where(mark.node_id, time_ns)
    if there is None:
        return ""
    north_m, east_m, _ = there.place_m
    level = material.level(there.floor_down_m)
    radius_m = radii95_m(there.covariance_m2)[0]
    return f"floor {level}, {north_m:.1f} m north, {east_m:.1f} m east, within {radius_m:.1f} m"


def _steps(material: Material, mark: Mark) -> str:
    told = []
    for step in mark.steps[1:]:
        after_s = f"after {step.at_s - mark.at_s:.0f} s"
        by = "" if step.by is None else f" by {step.by}"
        to = "" if step.to is None or step.stage != "assigned" else f" to {step.to}"
        told.append(f"{_at(material, step.at_s)} {step.stage}{to}{by} ({after_s})")
    told += [f"never acknowledged by {', '.join(mark.awaited)}"] if mark.awaited else []
    return "; ".join(told) or "nothing"


def _gaps(material: Material) -> str:
    line = material.timeline
    told = [
        f"{_at(material, gap.from_s)} to {_at(material, gap.to_s)} "
        f"({gap.to_s - gap.from_s:.0f} s): {gap.words}"
        for gap in line.gaps
    ]
    return _list([*told, *line.faults]) if told or line.faults else "<p>None.</p>"


def _evidence(verified: Verification, material: Material) -> Iterator[str]:
    journals = [
        f"{one.role} {one.node_id}: {one.last_number} numbered, {one.missing} missing"
        for one in verified.journals
        if one.missing
    ]
    counts, made = (
        ", ".join(f"{count} {topic}" for topic, count in each.items())
        for each in (verified.received, verified.made)
    )
    files = [f"file {one.name}, sha256 {one.sha256}" for one in verified.files]
    yield _list(
        [
            *files, f"messages, sha256 {verified.messages_sha256}", f"received: {counts}",
            f"made of it: {made}", verified.reading, *journals,
        ]
    )  # fmt: skip
    metadata = material.metadata
    fusion = material.settings.fusion
    settings = msgspec.json.format(msgspec.json.encode(fusion)).decode()
    version = metadata.get("software_version", "unknown")
    yield (
        f"<p>Made by Clew {escape(version)} (wire {escape(metadata.get('wire_version', '?'))}), "
        f"fused by <b>{escape(fusion.method)}</b> with these settings:</p>"
        f"<pre>{escape(settings)}</pre>"
    )


def _at(material: Material, at_s: float) -> str:
    return iso(material.timeline.begin_ns + round(at_s * NS_PER_S))[11:19]


def _figure(url: str, caption: str) -> str:
    told = escape(caption)
    return f'<figure><img src="{url}" alt="{told}"><figcaption>{told}</figcaption></figure>'


def _table(columns: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(each)}</th>" for each in columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(each)}</td>' for each in row)}</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _list(told: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(each)}</li>' for each in told)}</ul>"
