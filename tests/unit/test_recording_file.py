"""What stands in a recording is what was on the wire, in a form that others can read."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import jsonschema
import msgpack
import pytest
from mcap.reader import make_reader
from mcap.summary import Summary

from command_post.recorder import declarations
from command_post.recorder import file as recording_file
from command_post.recorder.file import EXCERPTS, RecorderError, RecordingFile
from command_post.recorder.schemas import json_schema
from shared.codec import Refusal, decode, encode, message_of, parse_key
from shared.mcap_reader import RecordedMessage, read_recording
from shared.topics import TOPICS
from tests.traffic import START_NS, increment, key_of, one_of_each, traffic

KEY = key_of("responder", "r1", "increment")


def written(path: Path, messages: list[RecordedMessage], **metadata: str) -> Path:
    file = RecordingFile(path, metadata)
    for message in messages:
        file.put(message.key, message.payload, message.log_time_ns, outgoing=message.outgoing)
    file.finish()
    return path


def recorded(
    key: str, payload: bytes, log_time_ns: int = START_NS, *, outgoing: bool = False
) -> RecordedMessage:
    message = message_of(key, payload)
    publish_time_ns = log_time_ns if isinstance(message, Refusal) else message.event_time_ns
    return RecordedMessage(log_time_ns, publish_time_ns, key, payload, outgoing)


def summary_of(path: Path) -> Summary:
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    return summary


def test_all_comes_back_to_the_bit_and_in_order(tmp_path: Path) -> None:
    messages = [recorded(key, payload, time_ns) for time_ns, key, payload in traffic(40)]
    messages += [recorded(key_of("post", "post", "track"), b"\x00\xff", outgoing=True)]
    recording = read_recording(written(tmp_path / "a.mcap", messages))
    assert list(recording) == messages
    assert recording.report.complete
    assert recording.report.message_count == len(messages)


def test_the_order_is_that_of_putting_even_if_the_clock_is_set_back(tmp_path: Path) -> None:
    times = [5, 9, 9, 2, 9, 3]
    messages = [recorded(KEY, b"%d" % number, time) for number, time in enumerate(times)]
    assert list(read_recording(written(tmp_path / "a.mcap", messages))) == messages


def test_both_clocks_are_kept(tmp_path: Path) -> None:
    stride = increment(4)
    path = written(
        tmp_path / "a.mcap",
        [recorded(KEY, encode(stride), START_NS + 9), recorded(KEY, b"?", START_NS + 10)],
    )
    with path.open("rb") as file:
        found = [message for _, _, message in make_reader(file).iter_messages()]
    assert [(m.log_time, m.publish_time, m.sequence) for m in found] == [
        (START_NS + 9, stride.event_time_ns, 4),
        (START_NS + 10, START_NS + 10, 0),
    ]


def test_each_key_has_one_channel_and_what_is_no_message_stands_apart(tmp_path: Path) -> None:
    sent = list(traffic(8))
    path = written(tmp_path / "a.mcap", [recorded(key, data, at) for at, key, data in sent])
    summary = summary_of(path)
    channels = {
        (channel.topic, channel.message_encoding, bool(channel.schema_id))
        for channel in summary.channels.values()
    }
    assert len(channels) == len(summary.channels)
    assert channels == {
        (key_of("responder", "r1", "increment"), "msgpack", True),
        (key_of("responder", "r2", "increment"), "msgpack", True),
        (key_of("responder", "r1", "increment"), "", False),
        ("clew/v9/test/responder/r1/increment", "", False),
        ("elsewhere/ü", "", False),
    }
    assert [(s.name, s.encoding) for s in summary.schemas.values()] == [
        ("OdometryIncrement", "jsonschema")
    ]


def test_every_topic_has_a_sample_here() -> None:
    assert {name: type(message) for name, message in one_of_each().items()} == {
        topic.name: topic.message for topic in TOPICS.values()
    }


@pytest.mark.parametrize("name", [name for name in TOPICS if TOPICS[name].recorded])
def test_the_schema_tells_other_languages_what_is_on_the_wire(name: str, tmp_path: Path) -> None:
    key = key_of(TOPICS[name].roles[0], "x1", name)
    path = written(tmp_path / "a.mcap", [recorded(key, encode(one_of_each()[name]))])
    with path.open("rb") as file:
        ((schema, _, message),) = make_reader(file).iter_messages()
    assert schema is not None
    assert schema.name == TOPICS[name].message.__name__
    validator = jsonschema.Draft202012Validator(json.loads(schema.data))
    validator.check_schema(validator.schema)
    fields = msgpack.unpackb(message.data)
    validator.validate(fields)
    assert not validator.is_valid({**fields, "sequence": -1})
    assert not validator.is_valid({k: v for k, v in fields.items() if k != "event_time_ns"})


def test_a_schema_is_one_object_without_outside_references() -> None:
    for topic in TOPICS.values():
        schema = json.loads(json_schema(topic.message))
        assert schema["type"] == "object"
        assert topic.message.__name__ not in schema["$defs"]


def test_metadata_says_what_was_recorded_and_with_what(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", [], incident="test", particles="400")
    metadata = read_recording(path).metadata
    assert metadata["incident"] == "test"
    assert metadata["particles"] == "400"
    assert metadata["wire_version"] == "v1"
    assert metadata["software_version"]


def test_of_a_giant_the_beginning_is_kept_and_its_size_and_hash(tmp_path: Path) -> None:
    giant = bytes(range(256)) * 8192
    path = written(tmp_path / "a.mcap", [recorded(KEY, giant), recorded(KEY, b"after")])
    recording = read_recording(path)
    first, after = recording
    assert first.key == after.key == KEY
    assert first.payload == giant[: recording_file.MAX_PAYLOAD_BYTES]
    assert after.payload == b"after"
    assert recording.report.excerpt_count == 1
    assert not recording.report.complete
    with path.open("rb") as file:
        ((_, _, message),) = make_reader(file).iter_messages(topics=[EXCERPTS])
    excerpt = msgpack.unpackb(message.data)
    assert excerpt["size_bytes"] == len(giant)
    assert excerpt["sha256"] == hashlib.sha256(giant).hexdigest()


def test_replay_refuses_a_giant_for_the_same_reason(tmp_path: Path) -> None:
    giant = encode(increment(0)) + bytes(3_000_000)
    (message,) = read_recording(written(tmp_path / "a.mcap", [recorded(KEY, giant)]))
    key = parse_key(KEY)
    assert not isinstance(key, Refusal)
    then, now = decode(key, giant), decode(key, message.payload)
    assert isinstance(then, Refusal)
    assert isinstance(now, Refusal)
    assert then.reason == now.reason == "too_large"


def test_made_up_keys_do_not_exhaust_the_channels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(declarations, "MAX_CHANNELS", 4)
    messages = [recorded(f"flood/{number}", b"%d" % number) for number in range(50)]
    messages += [recorded("flood/1", b"again"), recorded("flood/49", b"", outgoing=True)]
    path = written(tmp_path / "a.mcap", messages)
    recording = read_recording(path)
    assert list(recording) == messages
    assert recording.report.complete
    assert len(summary_of(path).channels) == 6


def test_a_topic_that_is_not_to_be_recorded_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(TOPICS, "increment", TOPICS["increment"]._replace(recorded=False))
    kept = recorded(key_of("dap", "d1", "rssi"), encode(one_of_each()["rssi"]))
    path = written(tmp_path / "a.mcap", [recorded(KEY, encode(increment(0))), kept])
    assert list(read_recording(path)) == [kept]


def test_the_same_messages_give_the_same_file(tmp_path: Path) -> None:
    messages = [recorded(key, data, at) for at, key, data in traffic(30)]
    one = written(tmp_path / "one.mcap", messages, incident="test")
    other = written(tmp_path / "other.mcap", messages, incident="test")
    assert one.read_bytes() == other.read_bytes()


def test_it_has_its_name_only_when_it_is_finished(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, {})
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mcap.part"]
    file.finish()
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mcap"]


def test_no_recording_is_overwritten_unless_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", [recorded(KEY, b"evidence")])
    with pytest.raises(RecorderError, match="is there already; give the recording another name"):
        RecordingFile(path, {})
    RecordingFile(path, {}, replace=True).abandon()
    assert [message.payload for message in read_recording(path)] == [b"evidence"]
    path.unlink()
    with pytest.raises(RecorderError, match=r"a\.mcap\.part: an unfinished recording"):
        RecordingFile(path, {})


def test_where_nothing_can_be_written_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(RecorderError, match=r"No such file or directory.*record somewhere else"):
        RecordingFile(tmp_path / "missing" / "a.mcap", {})
    (tmp_path / "a.mcap.part").symlink_to("/dev/full")
    with pytest.raises(RecorderError, match=r"No space left on device.*record somewhere else"):
        RecordingFile(tmp_path / "a.mcap", {}, replace=True)
