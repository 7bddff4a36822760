"""A page with an exercise on it, stopped at a moment: what the post makes of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from command_post.incident import Incident
from command_post.listening import Address
from command_post.replay import recorded_settings
from command_post.roster import RosterSettings, make_roster
from command_post.web.app import Site, make_app
from command_post.web.page import Page
from command_post.web.serving import LOCAL_NAMES, served
from shared.codec import encode
from shared.mcap_reader import read_recording
from shared.messages import Mayday
from shared.topics import Key
from shared.units import NS_PER_S

LOST_S = 120.0
"""Rehearsed access points say nothing while nobody comes by: they do not beat."""


class Staged:
    """A page, and the incident behind it."""

    def __init__(self, incident: Incident) -> None:
        self.incident = incident
        self.page = Page(incident.settings.incident)
        self.url = ""
        self.caller = ""
        """Who calls mayday."""

    def hear(self, key: str, payload: bytes, now_ns: int) -> None:
        """Have something come in, and what comes of it told."""
        for made in self.incident.handle(key, payload, now_ns):
            self.page.published(made.key, made.payload)

    def show(self, now_ns: int) -> None:
        """Have it be known who is where then."""
        self.page.show(make_roster(self.incident, now_ns, RosterSettings(lost_s=LOST_S)))

    def heed(self) -> bool:
        """Do what people have asked for, if they have."""
        asked = self.page.take_requests()
        for key, payload in asked:
            self.hear(key, payload, self.page.now_ns)
        self.show(self.page.now_ns)
        return bool(asked)


@contextmanager
def staged(recording: Path, until_s: float) -> Iterator[Staged]:
    """Serve what is known so long after a recording's beginning, when somebody calls mayday."""
    shown = Staged(Incident(recorded_settings(recording)))
    settings = shown.incident.settings
    heard = [each for each in read_recording(recording) if not each.outgoing]
    end_ns = heard[0].log_time_ns + round(until_s * NS_PER_S)
    for each in heard:
        if each.log_time_ns <= end_ns:
            shown.hear(each.key, each.payload, each.log_time_ns)
            shown.page.since(1)
    shown.caller = min(shown.incident.estimates)
    mayday = Mayday(
        event_time_ns=end_ns, sequence=0, phase="called", called_ns=end_ns, reason="button"
    )
    key = str(Key(settings.incident, "responder", shown.caller, "mayday"))
    shown.hear(key, encode(mayday), end_ns)
    shown.show(end_ns + 7 * NS_PER_S)
    site = Site(
        settings.incident, settings.post_id, shown.page, None, secure=False, hosts=LOCAL_NAMES
    )
    with served(lambda ends: make_app(site, ends), Address("127.0.0.1", 0), None) as url:
        shown.url = url
        yield shown
