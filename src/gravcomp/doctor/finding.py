"""Finding of a check."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One finding.

    level: 'ok', 'optional' (missing, and needed for some tasks only) or 'missing'; remedy: command that installs what is missing.
    """

    level: str
    subject: str
    found: str
    remedy: str = ""
