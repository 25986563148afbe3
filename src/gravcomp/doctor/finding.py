"""What an examination finds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """level: 'ok', 'optional' (something is missing that only some need) or 'missing'; remedy: the line that mends it."""

    level: str
    subject: str
    found: str
    remedy: str = ""
