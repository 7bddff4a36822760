"""What a recording's file declares: its channels and schemas, each by a number, as they come."""

from __future__ import annotations

from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from command_post.recorder.channels import FileChannel, marked
from command_post.recorder.layout import Declared
from command_post.recorder.mirror import Drawn
from command_post.recorder.schemas import MESSAGES, json_schema
from command_post.recorder.writer import RecordWriter
from shared.mcap_reader import CHANNEL

MAX_CHANNELS = 4096
"""Messages under further keys are kept as excerpts: made-up keys must not exhaust the format."""

_NO_SCHEMA = 0


class Declarations:
    """Numbers the channels and schemas of one file, whichever writer goes on with it.

    All that is ``declared`` in the file is there from the beginning. Whatever writes raises
    ``OSError`` as the file does.
    """

    def __init__(self, declared: Declared) -> None:
        self.declared = declared
        self._channels: dict[FileChannel, int] = {}
        self._schemas = {schema.name: number for number, schema in declared.schemas.items()}
        for number, channel in declared.channels.items():
            schema_of = declared.schemas.get(channel.schema_id)
            name = None if schema_of is None else schema_of.name
            self._channels[marked(channel.topic, name, channel.metadata)] = number

    @property
    def count(self) -> int:
        """How many channels are declared."""
        return len(self.declared.channels)

    def has_place(self, channel: FileChannel) -> bool:
        """Say whether ``channel`` is there, or one more may be."""
        return self.count < MAX_CHANNELS or channel in self._channels

    def number_of(
        self, channel: FileChannel, writer: RecordWriter, drawn: Drawn | None = None
    ) -> int:
        """Return the channel's number; a new one is declared, with the schema of what is drawn."""
        number = self._channels.get(channel)
        if number is None:
            marks = channel.marks
            schema_id = _NO_SCHEMA
            if channel.schema:
                schema_id = self._schema_id(channel.schema, writer, drawn)
            encoding = MessageEncoding.JSON if channel.derived else MessageEncoding.MessagePack
            encoding = encoding if channel.schema or channel.excerpt else ""
            number = writer.register_channel(channel.topic, encoding, schema_id, marks)
            declared = Channel(number, channel.topic, encoding, marks, schema_id)
            self.declared.channels[number] = declared
            self._channels[channel] = number
            _tell(declared, writer)
        return number

    def declare_again(self, writer: RecordWriter) -> None:
        """Have a writer that goes on with the file declare everything once more."""
        for schema in self.declared.schemas.values():
            writer.register_schema(schema.name, schema.encoding, schema.data)
        for channel in self.declared.channels.values():
            writer.register_channel(
                channel.topic, channel.message_encoding, channel.schema_id, channel.metadata
            )

    def tell_again(self, writer: RecordWriter, *, beyond: int) -> None:
        """Tell once more of the channels after the first ``beyond``: that was not safe yet."""
        for number in range(beyond + 1, self.count + 1):
            _tell(self.declared.channels[number], writer)

    def _schema_id(self, name: str, writer: RecordWriter, drawn: Drawn | None) -> int:
        if name not in self._schemas:
            data = json_schema(MESSAGES[name]) if drawn is None else drawn.schema_data
            number = writer.register_schema(name, SchemaEncoding.JSONSchema, data)
            self.declared.schemas[number] = Schema(number, data, SchemaEncoding.JSONSchema, name)
            self._schemas[name] = number
        return self._schemas[name]


def _tell(channel: Channel, writer: RecordWriter) -> None:
    """Name a channel outside of all chunks, so that it is known without unpacking one."""
    writer.add_metadata(
        CHANNEL, {"id": str(channel.id), "topic": channel.topic, **channel.metadata}
    )
