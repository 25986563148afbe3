"""Latency of a recorded graph: from the stamp of an IMU sample to the reception of each message that it caused."""

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.evaluation.recorded.run import RecordedRun, read, required
from gravcomp.recordings.bags.streams import CABLE_COMMAND, CABLE_STATE, VECTOR, Stream, Wanted
from gravcomp.report.drawing import Drawing
from gravcomp.report.result import Figure, Plot, Result, Table

_WANTED = {
    "gravity": Wanted(VECTOR, ("gravity",), optional=True),
    "command": Wanted(CABLE_COMMAND, ("cable/command",)),
    "motors": Wanted(CABLE_STATE, ("cable/state",), optional=True),
}
_NAMES = {"gravity": "gravity estimated", "command": "cables commanded", "motors": "command followed, by the state of the bridge"}
_CLOCKS = 10.0  # s; a longer delay means another clock


def run(recorded: RecordedRun) -> Result:
    """Return the evaluation. Raises ConfigError when stamps and times of reception are from different clocks."""
    streams = read(recorded.bag, _WANTED)
    delays = {name: _delays(stream) for name, stream in streams.items() if stream is not None}
    if not len(delays["command"]):
        raise ConfigError(
            f"{recorded.bag}: the stamps of '{required(streams, 'command').topic}' are of another clock than the recorder's,"
            " as in a replay"
        )
    figures = []
    for name, values in delays.items():
        if len(values):
            figures.append(Figure(f"{_NAMES[name]}, median", float(np.median(values)), "ms", "about 3 s", 100.0))
            figures.append(Figure(f"{_NAMES[name]}, 99th percentile", float(np.percentile(values, 99)), "ms", "about 3 s", 100.0))
    rows = [
        (_NAMES[name], len(values), *(float(np.percentile(values, p)) for p in (1, 50, 99, 100)))
        for name, values in delays.items()
        if len(values)
    ]
    return Result(
        name="delay",
        title="Delay, recorded",
        question="How long after the IMU sample was the message of each stage received?",
        ground=f"A recording of the running graph, {recorded.bag.name}: from the stamp of the IMU sample, which every message"
        " carries, to the reception of the message by the recorder.",
        figures=figures,
        parts=[
            Plot("Delays", _drawing(delays), "From the IMU sample's stamp."),
            Table("All stages", ("stage", "messages", "least, ms", "median, ms", "99 %, ms", "largest, ms"), rows),
        ],
        parameters={"bag": str(recorded.bag)},
        notes=["The bridge sends its state 100 times a second, so a command in it can be up to 10 ms old."],
    )


def _delays(stream: Stream) -> np.ndarray:
    """Return the delays (k,) in ms without those of another clock and of states that follow no command."""
    delays = 1e3 * (stream.received - stream.stamp)
    return delays[(delays >= 0.0) & (delays < 1e3 * _CLOCKS)]


def _drawing(delays: dict[str, np.ndarray]) -> str:
    with Drawing(1, 1, width=8.0, height=3.2) as drawing:
        last = max(20.0, *(float(np.percentile(values, 99.5)) for values in delays.values() if len(values)))
        for name, values in delays.items():
            drawing.axes.hist(values, bins=60, range=(0.0, last), alpha=0.6, label=_NAMES[name])
        drawing.axes.set_xlabel("ms")
        drawing.axes.set_ylabel("messages")
        drawing.axes.legend()
    return drawing.svg
