"""A wearer's call for help (pure): what a button means, and what is said until the post has heard.

A call stands until its wearer takes it back, or somebody at the post resolves it.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from shared.messages import Mayday, MaydayAnswer, NodeId, TimeNs

Act: TypeAlias = Literal["call", "cancel"]

CALLS_S = 1.0
"""A button held for so long calls: no knock against a door frame does."""

CANCELS_S = 3.0
"""Held for so long while a call stands, it takes the call back: nobody in need does so unaware."""

UNHEARD_PERIOD_S = 2.0
HEARD_PERIOD_S = 10.0
"""A call is said again so often, before and after the post has heard it."""

RESOLVED = "resolved at the post"


class HeldButton:
    """Tells what presses of a button mean; each, however long, means one thing at most."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def press(self, now_s: float) -> None:
        """Take in that it is down from ``now_s`` on, of a steady clock."""
        if self._since_s is None:
            self._since_s = now_s

    def release(self) -> None:
        """Take in that it is up."""
        self._since_s = None

    def act(self, now_s: float, *, stands: bool) -> Act | None:
        """Return what it means by ``now_s``, while a call ``stands`` or none does."""
        if self._since_s is None or now_s - self._since_s < (CANCELS_S if stands else CALLS_S):
            return None
        # It is to be let go of before it means anything else.
        self._since_s = float("inf")
        return "cancel" if stands else "call"


class Saying(NamedTuple):
    """What is to be said of a call, as ``Mayday`` has it."""

    phase: Literal["called", "cancelled"]
    called_ns: TimeNs
    since_ns: TimeNs
    reason: str


class MaydayCall:
    """Whether the wearer calls, and whether the post ``post_id`` has heard that, or its end."""

    def __init__(self, responder_id: NodeId, post_id: NodeId) -> None:
        self._responder_id = responder_id
        self._post_id = post_id
        self._saying: Saying | None = None
        self._heard = False
        self._told = ""
        self._said_s: float | None = None

    @property
    def stands(self) -> bool:
        """Whether the wearer has called, and it is not over."""
        return self._saying is not None and self._saying.phase == "called"

    def take(self, act: Act, reason: str, now_ns: TimeNs) -> str:
        """Do what the wearer wants at ``now_ns`` of the unit's clock; return in words what stands.

        What is wanted again is said again, and told again once it is answered.
        """
        saying = self._saying
        if act == "cancel" and saying is None:
            return "NOT CALLED"
        if saying is not None and (act == "call") == self.stands:
            self._say(saying)
        elif act == "call":
            self._say(Saying("called", now_ns, now_ns, reason))
        elif saying is not None:
            self._say(Saying("cancelled", saying.called_ns, now_ns, reason))
        return "CALLED" if self.stands else "CANCELLED"

    def go_on(self, said: Mayday) -> None:
        """Take up what was ``said`` before this process was broken off."""
        if said.phase == "called":
            self._say(Saying("called", said.called_ns, said.event_time_ns, said.reason))

    def hear(self, post_id: NodeId, answer: MaydayAnswer, now_ns: TimeNs) -> str | None:
        """Take in an answer; return in words what is new to the wearer, if anything is."""
        saying = self._saying
        if saying is None or post_id != self._post_id:
            return None
        answered = (answer.responder_id, answer.called_ns, answer.phase)
        if answered != (self._responder_id, saying.called_ns, saying.phase):
            return None
        self._heard = True
        words = f"{answer.stage.upper()}{'' if answer.by is None else f' BY {answer.by}'}"
        if saying.phase == "called" and answer.stage == "resolved":
            # Whoever still is in need calls anew.
            self._say(Saying("cancelled", saying.called_ns, now_ns, RESOLVED))
            return words
        if saying.phase == "cancelled":
            words = "END HEARD"
        if words == self._told or saying.reason == RESOLVED:
            return None
        self._told = words
        return words

    def due(self, now_s: float, *, linked: bool) -> Saying | None:
        """Return what is to be said by ``now_s`` of a steady clock.

        What is new is due at once, link or no link: it goes into the journal. Repeats are not.
        """
        saying = self._saying
        if saying is None:
            return None
        if self._said_s is not None:
            if self._heard and saying.phase == "cancelled":
                return None
            period_s = HEARD_PERIOD_S if self._heard else UNHEARD_PERIOD_S
            if not linked or now_s - self._said_s < period_s:
                return None
        self._said_s = now_s
        return saying

    def _say(self, saying: Saying) -> None:
        self._saying, self._said_s, self._heard, self._told = saying, None, False, ""
