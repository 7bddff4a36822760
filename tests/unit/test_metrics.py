"""What Prometheus and programs can read of the post, and who may."""

from __future__ import annotations

import http.client
import json
import socket
import ssl
import urllib.error
import urllib.request
from collections import Counter
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from command_post.listening import Address
from command_post.metrics.figures import Figures, by_reason
from command_post.metrics.prometheus import MOST_NODES_SHOWN, Metrics
from command_post.metrics.server import metrics_address, told
from command_post.nodes.freshness import Freshness
from command_post.recorder.backlog import RecorderStatus
from command_post.roster import Roster
from shared.bus.loopback import free_ports
from shared.codec import encode
from shared.security.bundle import AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE
from shared.units import NS_PER_S
from tests.issued_keys import Keys
from tests.traffic import START_NS, key_of, one_of_each

HERE = Address("127.0.0.1", 0)


def freshness(number: int) -> Freshness:
    return Freshness(
        role="responder",
        node_id=f"r{number:04}",
        alive=number % 2 == 0,
        heard_age_s=None if number == 1 else 0.25,
        rates_hz={"increment": 1.5},
        loss=None,
        behind=number,
        gone=0,
        unacknowledged=3,
        clock_offset_s=-2.0,
        clock_uncertainty_s=0.1,
        useless=0,
    )


def figures(nodes: int = 2) -> Figures:
    return Figures(
        roster=Roster(START_NS, (), (), tuple(freshness(number) for number in range(nodes))),
        heard=Counter(increment=7),
        turned_away=by_reason([(("forged", "a"), 3), (("forged", "b"), 4), (("unsigned", "a"), 1)]),
        refused={"invalid": 2},
        not_heard={"slowed": 100},
        only_counted=9,
        waiting=5,
        recorder=RecorderStatus(queued=11, written=12, dropped=13, fault=None),
        fusion={"late": 1},
        estimate_ages_s={"r1": 1.5},
    )


def values(metrics: Metrics) -> dict[tuple[str, ...], float]:
    families = text_string_to_metric_families(metrics.exposition().decode())
    return {
        (sample.name, *(value for _, value in sorted(sample.labels.items()))): sample.value
        for family in families
        for sample in family.samples
    }


def test_figures_come_out_as_prometheus_reads_them() -> None:
    metrics = Metrics()
    assert ("clew_inbox_messages",) not in values(metrics)
    metrics.show(figures())
    said = values(metrics)
    assert said["clew_messages_total", "increment"] == 7
    assert said["clew_turned_away_total", "forged"] == 7
    assert said["clew_not_heard_total", "slowed"] == 100
    assert said["clew_only_counted_total",] == 9
    assert said["clew_recorder_queued",] == 11
    assert said["clew_recorder_failing",] == 0
    assert said["clew_estimate_age_seconds", "r1"] == 1.5
    assert said["clew_node_alive", "r0001", "responder"] == 0
    assert said["clew_node_behind", "r0001", "responder"] == 1
    assert said["clew_node_rate_hz", "r0000", "responder", "increment"] == 1.5
    assert ("clew_node_heard_age_seconds", "r0001", "responder") not in said, "never heard"


def test_however_many_nodes_there_are_so_many_are_shown() -> None:
    metrics = Metrics()
    metrics.show(figures(MOST_NODES_SHOWN + 50))
    said = values(metrics)
    assert said["clew_nodes",] == MOST_NODES_SHOWN + 50
    assert sum(name[0] == "clew_node_alive" for name in said) == MOST_NODES_SHOWN


def test_only_estimates_count_for_the_latency() -> None:
    metrics = Metrics()
    metrics.handled(0.002)
    of_each = one_of_each()
    metrics.published(key_of("post", "p", "track"), encode(of_each["track"]), START_NS + NS_PER_S)
    metrics.published(key_of("post", "p", "fix"), encode(of_each["fix"]), START_NS)
    metrics.published("?", b"", START_NS)
    said = values(metrics)
    assert said["clew_handling_seconds_count",] == 1
    assert said["clew_estimate_latency_seconds_count",] == 1
    assert said["clew_estimate_latency_seconds_sum",] == 1.0


def fetch(where: Address, path: str) -> bytes:
    with urllib.request.urlopen(f"http://{where.host}:{where.port}{path}", timeout=10) as answer:
        body = answer.read()
        assert isinstance(body, bytes)
        return body


def test_metrics_and_roster_are_served_on_this_machine() -> None:
    where = Address("127.0.0.1", *free_ports(1))
    with told(where, None) as metrics:
        assert metrics is not None
        assert fetch(where, "/roster") == b"null"
        metrics.show(figures())
        assert b"clew_turned_away_total" in fetch(where, "/metrics")
        roster = json.loads(fetch(where, "/roster"))
        assert [node["node_id"] for node in roster["nodes"]] == ["r0000", "r0001"]
        assert roster["nodes"][1]["words"] == ["1 message behind"]
        with pytest.raises(urllib.error.HTTPError) as refused:
            fetch(where, "/etc/passwd")
        refused.value.close()
    with pytest.raises(urllib.error.URLError):
        fetch(where, "/metrics")


def test_who_asks_and_says_nothing_keeps_nobody_waiting() -> None:
    where = Address("127.0.0.1", *free_ports(1))
    with told(where, None), socket.create_connection(where):
        assert fetch(where, "/roster") == b"null"
        other = http.client.HTTPConnection(where.host, where.port, timeout=10)
        other.request("GET", "/roster")
        assert other.getresponse().read() == b"null"
        other.close()


def test_beyond_this_machine_only_those_with_a_certificate_are_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Address, "is_local", property(lambda _: False))
    keys = Keys(tmp_path / "keys", ("post", "commander"))
    where = Address("127.0.0.1", *free_ports(1))
    url = f"https://{where.host}:{where.port}/roster"
    context = ssl.create_default_context(cafile=keys["commander"].path(AUTHORITY_FILE))
    with told(where, keys["post"]):
        with pytest.raises((ssl.SSLError, OSError)):
            urllib.request.urlopen(url, context=context, timeout=10).read()
        with pytest.raises((urllib.error.URLError, http.client.HTTPException)):
            fetch(where, "/roster")
        own = keys["commander"]
        context.load_cert_chain(own.path(CERTIFICATE_FILE), own.path(KEY_FILE))
        with urllib.request.urlopen(url, context=context, timeout=10) as answer:
            assert answer.read() == b"null"


def test_without_an_address_nothing_is_counted() -> None:
    with told(None, None) as metrics:
        assert metrics is None


@pytest.mark.parametrize("text", ["9464", "127.0.0.1", "127.0.0.1:70000", "tcp/127.0.0.1:1"])
def test_a_malformed_address_is_told(text: str) -> None:
    with pytest.raises(ValueError, match="write HOST:PORT"):
        metrics_address(text, None)


@pytest.mark.parametrize("text", ["0.0.0.0:9464", "10.0.0.1:9464", "post.local:9464", "[::]:9464"])
def test_beyond_this_machine_it_needs_keys(text: str) -> None:
    with pytest.raises(ValueError, match="--keys"):
        metrics_address(text, None)


def test_loopback_addresses_are_taken() -> None:
    assert metrics_address("127.0.0.1:9464", None) == Address("127.0.0.1", 9464)
    assert metrics_address("[::1]:0", None) == Address("::1", 0)


def test_a_port_in_use_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        where = Address("127.0.0.1", server.getsockname()[1])
        with pytest.raises(OSError, match="use another port"), told(where, None):
            pass
