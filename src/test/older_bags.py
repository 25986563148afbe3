"""Bags as the recorders of earlier ROS 2 releases lay them out: metadata.yaml of version 4 to 8, SQLite and MCAP.

Version 5 added times of each file, 6 custom data, 7 the hashes of the types, 8 the release. Up to 8 the QoS profiles are text.
"""

import contextlib
import json
import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path

_QOS_TIME = "\n    sec: 9223372036\n    nsec: 854775807"
QOS = (
    f"- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2\n  deadline:{_QOS_TIME}\n  lifespan:{_QOS_TIME}"
    f"\n  liveliness: 1\n  liveliness_lease_duration:{_QOS_TIME}\n  avoid_ros_namespace_conventions: false"
)


@dataclass(frozen=True)
class Release:
    """What the recorder of a release writes. sqlite_schema: 0 where the file does not say it; types: definitions and hashes."""

    metadata: int
    sqlite_schema: int
    distro: str
    types: bool = False


RELEASES = {
    "galactic": Release(4, 0, ""),
    "humble, first": Release(5, 0, ""),
    "humble": Release(5, 3, "humble"),
    "before iron": Release(6, 3, "rolling"),
    "iron, without release": Release(7, 4, "iron", types=True),
    "iron": Release(8, 4, "iron", types=True),
}


@dataclass(frozen=True)
class Topic:
    """A topic with its messages: time of reception in ns and serialised content."""

    name: str
    kind: str
    messages: list[tuple[int, bytes]]
    definition: str = ""
    digest: str = ""


def write_sqlite(folder: Path, release: Release, topics: list[Topic]) -> Path:
    """Write a bag with one SQLite file."""
    folder.mkdir()
    file = folder / f"{folder.name}_0.db3"
    with contextlib.closing(sqlite3.connect(file)) as bag:
        hashed = ", type_description_hash TEXT NOT NULL" if release.sqlite_schema >= 4 else ""
        bag.executescript(f"""
            CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
                serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL{hashed});
            CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
                data BLOB NOT NULL);
            CREATE INDEX timestamp_idx ON messages (timestamp ASC);
        """)
        if release.sqlite_schema:
            bag.executescript("""
                CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
                CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
            """)
            bag.execute("INSERT INTO schema VALUES(?, ?)", (release.sqlite_schema, release.distro))
        if release.sqlite_schema >= 4:
            bag.execute(
                "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,"
                " encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)"
            )
        for number, topic in enumerate(topics, 1):
            row = (number, topic.name, topic.kind, "cdr", QOS, *([topic.digest] if hashed else []))
            bag.execute(f"INSERT INTO topics VALUES({', '.join('?' * len(row))})", row)
            if release.sqlite_schema >= 4:
                definition = (number, topic.kind, "ros2msg", topic.definition, topic.digest)
                bag.execute("INSERT INTO message_definitions VALUES(?, ?, ?, ?, ?)", definition)
            rows = ((number, time, content) for time, content in topic.messages)
            bag.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
        bag.commit()
    _write_metadata(folder, file.name, "sqlite3", release, topics)
    return folder


def write_mcap(folder: Path, release: Release, topics: list[Topic]) -> Path:
    """Write a bag with one MCAP file that has neither chunks nor an index, as the profile `fastwrite` does."""
    folder.mkdir()
    file = folder / f"{folder.name}_0.mcap"
    data = b"\x89MCAP0\r\n" + _record(0x01, _text("ros2") + _text("libmcap 0.4.0"))
    for number, topic in enumerate(topics, 1):
        definition = topic.definition.encode()
        schema = struct.pack("<H", number) + _text(topic.kind) + _text("ros2msg")
        data += _record(0x03, schema + struct.pack("<I", len(definition)) + definition)
        about = _text("offered_qos_profiles") + _text(QOS)
        about += _text("topic_type_hash") + _text(topic.digest) if release.types else b""
        ids = struct.pack("<HH", number, number)
        data += _record(0x04, ids + _text(topic.name) + _text("cdr") + struct.pack("<I", len(about)) + about)
    received = ((time, number, content) for number, topic in enumerate(topics, 1) for time, content in topic.messages)
    for k, (time, number, content) in enumerate(sorted(received)):
        data += _record(0x05, struct.pack("<HIQQ", number, k, time, time) + content)
    data += _record(0x0F, struct.pack("<I", 0)) + _record(0x02, struct.pack("<QQI", 0, 0, 0)) + b"\x89MCAP0\r\n"
    file.write_bytes(data)
    _write_metadata(folder, file.name, "mcap", release, topics)
    return folder


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text.encode())) + text.encode()


def _write_metadata(folder: Path, file: str, storage: str, release: Release, topics: list[Topic]) -> None:
    times = [time for topic in topics for time, _ in topic.messages]
    first, last = min(times), max(times)
    lines = [
        "rosbag2_bagfile_information:", f"  version: {release.metadata}", f"  storage_identifier: {storage}",
        "  duration:", f"    nanoseconds: {last - first}", "  starting_time:", f"    nanoseconds_since_epoch: {first}",
        f"  message_count: {len(times)}", "  topics_with_message_count:"]  # fmt: skip
    for topic in topics:
        lines += [
            "    - topic_metadata:", f"        name: {topic.name}", f"        type: {topic.kind}",
            "        serialization_format: cdr", f"        offered_qos_profiles: {json.dumps(QOS)}"]  # fmt: skip
        lines += [f"        type_description_hash: {topic.digest}"] if release.metadata >= 7 else []
        lines += [f"      message_count: {len(topic.messages)}"]
    lines += ['  compression_format: ""', '  compression_mode: ""', "  relative_file_paths:", f"    - {file}"]
    if release.metadata >= 5:
        lines += [
            "  files:", f"    - path: {file}", "      starting_time:", f"        nanoseconds_since_epoch: {first}",
            "      duration:", f"        nanoseconds: {last - first}", f"      message_count: {len(times)}"]  # fmt: skip
    lines += ["  custom_data: ~"] if release.metadata >= 6 else []
    lines += [f"  ros_distro: {release.distro}"] if release.metadata >= 8 else []
    (folder / "metadata.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
