"""The program that viewers look at, and what it recorded."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from mcap.reader import make_reader
from viewer import Said

SERVER = os.environ["SIM_SERVER"]


class Run:
    """A program under way, where its viewers connect, and what it says on stderr."""

    def __init__(self, process: subprocess.Popen[str], url: str, folder: Path) -> None:
        self.process = process
        self.url = url
        self.folder = folder

    def end(self) -> str:
        """Ends it as SIGTERM does; the rest of what it said."""
        self.process.send_signal(signal.SIGTERM)
        _, said = self.process.communicate(timeout=60)
        assert self.process.returncode == 0, said
        return said


def running(folder: Path, *options: str) -> AbstractContextManager[Run]:
    """A run that is shown to viewers."""
    return started(folder, "run", "--headless", "--out", folder, *options)


def played(file: Path) -> AbstractContextManager[Run]:
    """A recording that is shown to viewers."""
    return started(file.parent, "play", file)


@contextmanager
def started(folder: Path, *words: str | Path) -> Iterator[Run]:
    """The program, with a free port for viewers."""
    command: list[str | Path] = [SERVER, *words, "--foxglove", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr is not None
            line = process.stderr.readline()
            found = re.search(r"ws://127\.0\.0\.1:\d+", line)
            assert found is not None, line
            yield Run(process, found.group(), folder)
        finally:
            process.kill()


def recorded(file: Path) -> tuple[dict[str, tuple[str, str, bytes]], list[Said]]:
    """Topics with type, encoding and definition, and messages of a recording."""
    with file.open("rb") as source:
        reader = make_reader(source)
        summary = reader.get_summary()
        assert summary is not None
        topics = {}
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            topics[channel.topic] = (schema.name, schema.encoding, schema.data)
            assert channel.message_encoding == "cdr"
        messages = [
            Said(channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages()
        ]
    return topics, messages
