"""What an incident says, as messages of its post: numbered, and under the post's keys (pure)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from shared.codec import encode
from shared.messages import Alert, DapEstimate, MaydayAnswer, Message, NodeId, TrackEstimate
from shared.topics import TOPIC_OF, Key


class Outgoing(NamedTuple):
    """A message to publish."""

    key: str
    payload: bytes


class Announcer:
    """Makes what a post publishes."""

    def __init__(self, incident: NodeId, post_id: NodeId) -> None:
        self._incident = incident
        self._post_id = post_id
        self._sequences: Counter[str] = Counter()
        self._keys: dict[type[Message], str] = {}
        """What each kind of message goes under."""

    def next_sequence(self, topic: str) -> int:
        """Return the number of the next message of ``topic``, and count it."""
        number = self._sequences[topic]
        self._sequences[topic] += 1
        return number

    def go_on(self, next_sequences: Mapping[str, int]) -> None:
        """Number what is said from now on as it is to be next, by topic."""
        self._sequences = Counter(next_sequences)

    def outgoing(self, message: Message) -> Outgoing:
        """Return a message as it is to be published."""
        kind = type(message)
        key = self._keys.get(kind)
        if key is None:
            key = str(Key(self._incident, "post", self._post_id, TOPIC_OF[kind].name))
            self._keys[kind] = key
        return Outgoing(key, encode(message))

    def alert(self, alert: Alert) -> Outgoing:
        """Say how an alert stands."""
        numbered = msgspec.structs.replace(alert, sequence=self.next_sequence("alert"))
        return self.outgoing(numbered)

    def mayday_answer(self, answer: MaydayAnswer) -> Outgoing:
        """Answer whoever calls mayday."""
        number = self.next_sequence("mayday_answer")
        return self.outgoing(msgspec.structs.replace(answer, sequence=number))

    def track(self, responder_id: str, estimate: Estimate) -> Outgoing:
        """Say where a responder is held to be."""
        return self.outgoing(
            TrackEstimate(
                event_time_ns=estimate.time_ns,
                sequence=self.next_sequence("track"),
                responder_id=responder_id,
                north_m=estimate.north_m,
                east_m=estimate.east_m,
                down_m=estimate.down_m,
                covariance_m2=estimate.covariance_m2,
                heading_rad=estimate.heading_rad,
                heading_sd_rad=estimate.heading_sd_rad,
                last_proximity_time_ns=estimate.last_proximity_time_ns,
                down_sd_m=estimate.down_sd_m,
                regions_m=estimate.regions_m,
                floors=estimate.floors,
                status=estimate.status,
                reason=estimate.reason,
            )
        )

    def dap_place(self, dap_id: str, dap: InstalledDap, said_ns: int) -> Outgoing:
        """Say where a DAP stands since ``said_ns``: the time that it gave its installation."""
        return self.outgoing(
            DapEstimate(
                event_time_ns=said_ns,
                sequence=self.next_sequence("dap_place"),
                dap_id=dap_id,
                position=dap.position,
            )
        )
