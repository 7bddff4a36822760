"""The demo: a whole incident on one machine, every node its own process, over Zenoh on loopback.

It is as in earnest: the launcher names all nodes by an authority made for this demo, so that links
are encrypted and what is said is signed. It starts the post, the DAPs and the agents of a scenario,
waits until all are alive, gives the start, and scores the recording against the simulated truth
when all have finished.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from datetime import UTC, datetime
from threading import Event

from command_post.authority import Authority
from command_post.children import Children
from command_post.demo_settings import DemoSettings
from command_post.last_words import LastWords
from shared.bus.interface import Bus, Received
from shared.bus.loopback import free_port, free_ports
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import ScaledClock, SystemClock
from shared.codec import Refusal, decode, parse_key
from shared.introductions import Introductions
from shared.mcap_reader import RecordedMessage
from shared.messages import Beat, ExerciseStart, Message
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.sender import Sender, Unkept
from shared.topics import Key, Role, alive_key, all_alive_of, finished_key
from shared.units import NS_PER_S

INCIDENT = "demo"
POST_ID = "post"
LAUNCHER_ID = "launcher"
PREPARATIONS = ("agents.prepare", "post.prepare")
"""Names that no node can have."""

PREPARED_SOON_S = 3.0
READY_TIMEOUT_S = 90.0
POLL_S = 0.1
PAGE_PORT = 8080
"""Where the page is, if nothing else is there."""

KEYS_DAYS = 7
SAFE_SOON_S = 6.0
SAFE_TIMEOUT_S = 120.0
"""The post acknowledges every other second what is on its disk; one that is behind takes longer."""


class DemoError(RuntimeError):
    """The demo could not run; the text says which node failed and where its log is."""


def run_demo(settings: DemoSettings, stop: Event, say: Callable[[str], None]) -> bool:
    """Run the whole scenario; return whether it ran to its end before ``stop`` was set.

    Raises ``DemoError`` when a node fails. However it ends, no process is left and the recording
    is finished.
    """
    with Children(settings.logs) as children:
        if not _prepare(settings, children, stop, say):
            return False
        own_keys = _issue_keys(settings)
        page = f"127.0.0.1:{free_port(PAGE_PORT)}"
        locators = _start_nodes(settings, children, page)
        with (
            open_zenoh("client", connect=[locators[POST_ID]], bundle=own_keys) as bus,
            Introductions(bus, INCIDENT, own_keys) as introductions,
        ):
            say("starting " + ", ".join(children.running()))
            say(f"page: http://{page}/")
            if not _wait_until_alive(settings, bus, children, stop):
                return False
            if not introductions.introduce():
                raise DemoError(f"the post does not answer; its log: {children.log(POST_ID)}")
            start = _give_the_start(settings, bus, own_keys)
            say(f"exercise started: {start.scenario}, seed {start.seed}, {start.speed:g}x")
            watch_the_pace(settings, bus, start, say)
            if not (
                _wait_until_finished(settings, bus, children, stop, say)
                and _wait_until_safe(bus, children, stop, say)
            ):
                say("stopping " + ", ".join(children.running()))
                return False
            # The post first: its last look at the roster is to find everybody there.
            children.stop([POST_ID])
            _check(children, [POST_ID])
    return True


def _prepare(
    settings: DemoSettings, children: Children, stop: Event, say: Callable[[str], None]
) -> bool:
    """Build the agents' machine code and the post's once, before anybody waits for it."""
    method = () if settings.method is None else ("--method", settings.method)
    agents, post = PREPARATIONS
    children.start(agents, "edge_agent", ("prepare", "--with-parent", *method))
    children.start(post, "command_post", ("prepare", "--with-parent"))
    clock = SystemClock()
    soon_ns = clock.now_ns() + round(PREPARED_SOON_S * NS_PER_S)
    told = False
    while children.running():
        if not told and clock.real_seconds_until(soon_ns) < 0.0:
            told = True
            say("building machine code, once after an installation")
        if stop.wait(POLL_S):
            return False
    _check(children, PREPARATIONS)
    return True


def _issue_keys(settings: DemoSettings) -> Bundle:
    """Name all nodes of the demo; return the launcher's own keys."""
    named: dict[Role, Iterable[str]] = {
        "post": [POST_ID, LAUNCHER_ID],
        "dap": settings.scenario.daps,
        "responder": settings.scenario.responders,
    }
    now = datetime.now(UTC).replace(microsecond=0)
    authority = Authority.create(settings.keys, now, KEYS_DAYS)
    nodes = [Identity(role, node_id) for role, ids in named.items() for node_id in ids]
    authority.issue(nodes, (), now, KEYS_DAYS)
    return Bundle(settings.keys / LAUNCHER_ID)


def _start_nodes(settings: DemoSettings, children: Children, page: str) -> dict[str, str]:
    names = [POST_ID, *settings.scenario.daps]
    ports = zip(names, free_ports(len(names)), strict=True)
    locators = {name: f"tls/127.0.0.1:{port}" for name, port in ports}
    common = ("--incident", INCIDENT, "--await-start", "--with-parent")

    def named(node_id: str) -> tuple[str, ...]:
        return ("--id", node_id, "--keys", str(settings.keys / node_id), *common)

    def kept(node_id: str) -> tuple[str, ...]:
        return (*named(node_id), "--journal", str(settings.journals / f"{node_id}.journal"))

    simulated = f"simulated:{settings.scenario_name}"
    seed = ("--seed", str(settings.seed))
    table = ("--table",) if settings.shows_table else ()
    children.start(
        POST_ID,
        "command_post",
        ("run", *named(POST_ID), "--listen", locators[POST_ID],
         "--record", str(settings.recording), *seed, "--hold", str(settings.hold_s), "--page", page,
         *table),
        shows=True,
    )  # fmt: skip
    for dap_id in settings.scenario.daps:
        children.start(
            dap_id,
            "dap_node",
            ("run", *kept(dap_id), "--source", simulated, *seed,
             "--listen", locators[dap_id], "--connect", locators[POST_ID]),
        )  # fmt: skip
    method = () if settings.method is None else ("--method", settings.method)
    dials = [part for name in reversed(names) for part in ("--connect", locators[name])]
    for responder_id in settings.scenario.responders:
        children.start(
            responder_id,
            "edge_agent",
            ("run", *kept(responder_id), "--source", simulated, *seed, *method, *dials),
        )
    return locators


def _wait_until_alive(settings: DemoSettings, bus: Bus, children: Children, stop: Event) -> bool:
    expected = {
        alive_key(INCIDENT, "post", POST_ID),
        *(alive_key(INCIDENT, "dap", dap_id) for dap_id in settings.scenario.daps),
        *(alive_key(INCIDENT, "responder", one) for one in settings.scenario.responders),
    }
    alive: set[str] = set()
    bus.watch_alive(
        all_alive_of(INCIDENT),
        lambda key, is_alive: alive.add(key) if is_alive else alive.discard(key),
    )
    clock = SystemClock()
    deadline_ns = clock.now_ns() + round(READY_TIMEOUT_S * NS_PER_S)
    while not expected <= alive:
        _check(children, children.names())
        if clock.real_seconds_until(deadline_ns) < 0.0:
            missing = ", ".join(sorted(expected - alive))
            raise DemoError(f"not alive after {READY_TIMEOUT_S:g} s: {missing}")
        if stop.wait(POLL_S):
            return False
    return True


def _wait_until_finished(
    settings: DemoSettings,
    bus: Bus,
    children: Children,
    stop: Event,
    say: Callable[[str], None],
) -> bool:
    """Wait until every responder who still runs has walked their route."""
    finished: set[str] = set()
    for one in settings.scenario.responders:
        bus.watch_alive(finished_key(INCIDENT, one), lambda key, _: finished.add(key))
    told: set[str] = set()
    while True:
        _check(children, [POST_ID])
        for ended in children.failed():
            if ended.name not in told:
                told.add(ended.name)
                say(f"{ended}; going on without; its log: {children.log(ended.name)}")
        walking = settings.scenario.responders.keys() & set(children.running())
        if all(finished_key(INCIDENT, one) in finished for one in walking):
            return True
        if stop.wait(POLL_S):
            return False


def _wait_until_safe(bus: Bus, children: Children, stop: Event, say: Callable[[str], None]) -> bool:
    """Wait until the post, which may be behind, has all that was said; it fuses that at its end."""
    last_words = LastWords()

    def hear(received: Received) -> None:
        node_id, beat = _said_in(received)
        if isinstance(beat, Beat):
            last_words.hear(node_id, beat)

    roles: tuple[Role, ...] = ("responder", "dap")
    for role in roles:
        bus.subscribe(str(Key(INCIDENT, role, "*", "beat")), hear)
    clock = SystemClock()
    began_ns = clock.now_ns()
    told = False
    while not last_words.are_safe(name for name in children.running() if name != POST_ID):
        _check(children, [POST_ID])
        waited_s = -clock.real_seconds_until(began_ns)
        if waited_s > SAFE_TIMEOUT_S:
            say("the post does not catch up: its recording lacks what was said last")
            return True
        if waited_s > SAFE_SOON_S and not told:
            told = True
            say("the post is behind, and waited for; give a lower --speed on this machine")
        if stop.wait(POLL_S):
            return False
    return True


def _give_the_start(settings: DemoSettings, bus: Bus, own_keys: Bundle) -> ExerciseStart:
    sender = Sender(bus, INCIDENT, "post", LAUNCHER_ID, Unkept(own_keys.sign))
    start = ExerciseStart(
        event_time_ns=SystemClock().now_ns(),
        sequence=sender.next_sequence(ExerciseStart),
        scenario=settings.scenario_name,
        seed=settings.seed,
        speed=settings.speed,
    )
    payload = sender.send(start)
    bus.answer(sender.key(ExerciseStart), lambda _: payload)
    return start


def watch_the_pace(
    settings: DemoSettings, bus: Bus, start: ExerciseStart, say: Callable[[str], None]
) -> None:
    """Say it once if nodes do not keep up with the exercise's clock."""
    clock = ScaledClock(start.event_time_ns, start.speed)
    told = Event()

    def watch(received: Received) -> None:
        """Compare a message's time with the exercise's."""
        node_id, message = _said_in(received)
        if message is None or told.is_set():
            return
        behind_s = (clock.now_ns() - message.event_time_ns) / NS_PER_S
        if behind_s > settings.late_s:
            told.set()
            say(
                f"this machine falls behind at {start.speed:g}x: {node_id} is "
                f"{behind_s:.0f} s late; give a lower --speed"
            )

    bus.subscribe(str(Key(INCIDENT, "responder", "*", "increment")), watch)


def why_told_late(recording: Iterable[RecordedMessage], settings: DemoSettings) -> str | None:
    """Return what is to be said of a post that did not keep up; its score is worse for that.

    The launcher hears units that keep up; only the recording tells when the post came to them.
    """
    behind_s = max(
        (
            (each.log_time_ns - each.publish_time_ns) / NS_PER_S
            for each in recording
            if each.key.endswith("/increment")
        ),
        default=0.0,
    )
    if behind_s <= settings.late_s:
        return None
    return (
        f"the post fell {behind_s:.0f} s behind at {settings.speed:g}x, and what it told live is "
        "worse for that; give a lower --speed on this machine"
    )


def _said_in(received: Received) -> tuple[str, Message | None]:
    """Return who said it, and what; no message if it is refused."""
    key = parse_key(received.key)
    if isinstance(key, Refusal):
        return "", None
    message = decode(key, received.payload)
    return key.node_id, None if isinstance(message, Refusal) else message


def _check(children: Children, needed: Collection[str]) -> None:
    for ended in children.failed():
        if ended.name in needed:
            raise DemoError(f"{ended}; its log: {children.log(ended.name)}")
