"""Making a whole recording of one that was broken off or damaged.

All messages that can be read are put into a new file in their order, with what is known of the
incident; the damaged one stays as it is. The new file names the old one, so that nobody takes it
for the untouched record.
"""

from __future__ import annotations

from pathlib import Path

from command_post.recorder.file import RecorderError, RecordingFile
from command_post.recorder.mirror import Mirror
from shared.mcap_reader import ReadReport, RecordingError, read_recording

SALVAGED = "salvaged_from"
"""What the new recording's metadata says of the old one."""


def salvage(damaged: Path, output: Path, mirror: Mirror | None = None) -> ReadReport:
    """Put all that can be read of ``damaged`` into a new recording, ``output``; say what that was.

    ``mirror`` draws it, to be looked at. Raises ``RecordingError`` if there is nothing to be read,
    ``RecorderError`` if ``output`` is there already or cannot be written; then nothing is left.
    """
    recording = read_recording(damaged)
    if not recording.metadata:
        raise RecordingError(f"{damaged}: what it is a recording of cannot be read")
    metadata = {**recording.metadata, SALVAGED: damaged.name}
    file = RecordingFile(output, metadata, mirror=mirror)
    try:
        for log_time_ns, _, key, payload, outgoing in recording:
            file.put(key, payload, log_time_ns, outgoing=outgoing)
        if recording.report.dropped_count:
            file.mark_dropped(recording.report.dropped_count)
        if recording.report.end_ns is not None:
            file.mark_end(recording.report.end_ns)
        file.finish()
    except OSError as error:
        file.discard()
        raise RecorderError(f"{output}: cannot be written ({error.strerror})") from error
    except BaseException:
        file.discard()
        raise
    return recording.report
