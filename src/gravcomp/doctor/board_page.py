"""The page of the board's bench test: step by step what to connect, what was measured, and what is expected."""

import dataclasses
import time
from pathlib import Path

from gravcomp.doctor.finding import Finding
from gravcomp.report.page import write_report
from gravcomp.report.result import Figure, Result, Table

_CONNECT = {
    "board": "Board with 24 V and the CAN bus of the host, 1 Mbit/s, both terminators. Motors without power.",
    "samples": "As before. The board lies still.",
    "noise": "As before.",
    "delay of answers": "As before.",
    "heater": "As before. Nothing touches the sensor.",
    "state": "As before.",
    "feedback": "Power for the motors. The cable of this motor is unhooked, so that its rotor turns freely.",
    "current step": "As before.",
    "dead host": "As before.",
}
_LEVELS = {"ok": "as expected", "optional": "look at it", "missing": "not as expected"}


@dataclasses.dataclass
class BenchTest(Result):
    """The result of a bench test."""

    @property
    def command(self) -> str:
        """Command that makes this result, without `./gravcomp`."""
        return "doctor --board"


def write_page(findings: list[Finding], interface: str, channel: str, folder: Path) -> Path:
    """Write board.html and board.json into the folder; return the path of the page."""
    rows: list[tuple] = []
    for number, finding in enumerate(findings, 1):
        connect = _CONNECT.get(finding.subject, "")
        said = f"{finding.found}{' — ' + finding.remedy if finding.remedy else ''}"
        rows.append((number, finding.subject, connect, said, _LEVELS[finding.level]))
    wrong = sum(finding.level == "missing" for finding in findings)
    result = BenchTest(
        name="board",
        title="Bench test of a board",
        question="Does the firmware do on this board what it does in the emulator?",
        ground=f"Board on {interface} {channel}, {time.strftime('%Y-%m-%d %H:%M')}. Please send this page with a description of"
        " the set-up: board, motors, cables of the bus, supply.",
        figures=[Figure("steps that are not as expected", wrong, "", limit=0)],
        parts=[Table("Steps", ("", "step", "what to connect", "measured, and expected", ""), rows)],
        parameters={"interface": interface, "channel": channel},
    )
    return write_report(result, folder)
