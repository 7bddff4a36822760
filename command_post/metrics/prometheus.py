"""The post's figures as Prometheus reads them.

Labels are names of topics and reasons, which are ours, and of nodes, of which so many are shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from prometheus_client import CollectorRegistry, Histogram, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from command_post.metrics.figures import Figures
from command_post.nodes.freshness import Freshness
from command_post.roster_json import roster_json
from shared.codec import message_of
from shared.messages import TrackEstimate
from shared.units import NS_PER_S

MOST_NODES_SHOWN = 1024

_HANDLED_S = (0.0001, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_LATE_S = (0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0, 60.0, 300.0)


class Metrics(Collector):
    """Holds the newest figures; any thread may ask for them."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self._handled = Histogram(
            "clew_handling_seconds",
            "Time to record, fuse and publish what comes of one message.",
            buckets=_HANDLED_S,
            registry=self._registry,
        )
        self._late = Histogram(
            "clew_estimate_latency_seconds",
            "From what happened to the estimate of it, on the post's clock; waiting for late"
            " messages included.",
            buckets=_LATE_S,
            registry=self._registry,
        )
        self._figures: Figures | None = None
        self._registry.register(self)

    def handled(self, seconds: float) -> None:
        """Note how long a message took to handle."""
        self._handled.observe(seconds)

    def published(self, key_text: str, payload: bytes, now_ns: int) -> None:
        """Note how long after it happened an estimate was published, at ``now_ns``."""
        message = message_of(key_text, payload)
        if isinstance(message, TrackEstimate):
            self._late.observe(max(now_ns - message.event_time_ns, 0) / NS_PER_S)

    def show(self, figures: Figures) -> None:
        """Tell these figures from now on."""
        self._figures = figures

    def exposition(self) -> bytes:
        """Return everything in Prometheus' text format."""
        return generate_latest(self._registry)

    def roster(self) -> bytes:
        """Return the newest roster as JSON, ``null`` before there is one."""
        return b"null" if self._figures is None else roster_json(self._figures.roster)

    def collect(self) -> Iterable[Metric]:
        """Yield the newest figures as metrics; Prometheus' client asks."""
        figures = self._figures
        return () if figures is None else (*_of_post(figures), *_of_nodes(figures))


def _of_post(figures: Figures) -> Iterator[Metric]:
    yield _counter("clew_messages", "Messages let in.", "topic", figures.heard)
    yield _counter(
        "clew_turned_away", "Messages the gate turned away.", "reason", figures.turned_away
    )
    yield _counter(
        "clew_refused", "Messages let in that could not be used.", "reason", figures.refused
    )
    yield _counter(
        "clew_not_heard", "Messages lost before they were looked at.", "reason", figures.not_heard
    )
    yield CounterMetricFamily(
        "clew_only_counted", "Useless messages beyond what is kept.", value=figures.only_counted
    )
    yield _counter("clew_fusion", "What the fusion says of its input.", "what", figures.fusion)
    yield _gauge("clew_inbox_messages", "Messages that wait to be handled.", figures.waiting)
    orders = sum(len(row.orders) for row in figures.roster.responders)
    yield _gauge("clew_orders_unacknowledged", "Orders that await a responder's word.", orders)
    recorder = figures.recorder
    yield _gauge("clew_recorder_queued", "Messages not yet written to disk.", recorder.queued)
    failing = recorder.fault is not None
    yield _gauge("clew_recorder_failing", "1 if nothing is recorded now.", failing)
    yield _counter(
        "clew_recorder_messages",
        "Messages written and lost by the recorder.",
        "outcome",
        {"written": recorder.written, "dropped": recorder.dropped},
    )
    ages = GaugeMetricFamily(
        "clew_estimate_age_seconds", "Age of the newest estimate.", labels=["responder"]
    )
    for responder_id in sorted(figures.estimate_ages_s)[:MOST_NODES_SHOWN]:
        ages.add_metric([responder_id], figures.estimate_ages_s[responder_id])
    yield ages


_OF_NODE: tuple[tuple[str, str, Callable[[Freshness], float | None]], ...] = (
    ("alive", "1 if it is on the network.", lambda node: float(node.alive)),
    ("heard_age_seconds", "Since it was heard.", lambda node: node.heard_age_s),
    ("behind", "Messages of its journal that are not here.", lambda node: node.behind),
    ("gone", "Messages of its journal that are lost for good.", lambda node: node.gone),
    ("unacknowledged", "Messages only its journal has.", lambda node: node.unacknowledged),
    ("loss", "Share lost of what is only said once.", lambda node: node.loss),
    ("clock_offset_seconds", "Post's clock ahead of its own.", lambda node: node.clock_offset_s),
    ("useless", "Messages of no use that it has sent.", lambda node: node.useless),
)


def _of_nodes(figures: Figures) -> Iterator[Metric]:
    nodes = figures.roster.nodes[:MOST_NODES_SHOWN]
    yield _gauge("clew_nodes", "Nodes heard of, shown here or not.", len(figures.roster.nodes))
    for name, words, of in _OF_NODE:
        family = GaugeMetricFamily(f"clew_node_{name}", words, labels=["role", "node"])
        for node in nodes:
            value = of(node)
            if value is not None:
                family.add_metric([node.role, node.node_id], value)
        yield family
    rates = GaugeMetricFamily(
        "clew_node_rate_hz", "Messages a second of late.", labels=["role", "node", "topic"]
    )
    for node in nodes:
        for topic, rate_hz in sorted(node.rates_hz.items()):
            rates.add_metric([node.role, node.node_id, topic], rate_hz)
    yield rates


def _gauge(name: str, words: str, value: float) -> Metric:
    return GaugeMetricFamily(name, words, value=value)


def _counter(name: str, words: str, label: str, counts: Mapping[str, int]) -> Metric:
    family = CounterMetricFamily(name, words, labels=[label])
    for value, count in sorted(counts.items()):
        family.add_metric([value], count)
    return family
