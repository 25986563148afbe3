"""Result of an experiment as plain data, for JSON and the report page: figures, tables, plots, parameters."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Figure:
    """One figure of merit.

    article: the article's value, as text; limit: to be reached, from above when `at_least`, else from below, or None; digits:
    significant digits of the text.
    """

    name: str
    value: float
    unit: str
    article: str = ""
    limit: float | None = None
    at_least: bool = False
    digits: int = 3

    @property
    def reached(self) -> bool | None:
        """Whether the figure reaches its limit; None without a limit. NaN reaches no limit."""
        if self.limit is None:
            return None
        return bool(self.value >= self.limit if self.at_least else self.value <= self.limit)

    @property
    def target(self) -> str:
        """The limit as text."""
        if self.limit is None:
            return ""
        return f"{'≥' if self.at_least else '≤'} {self.limit:.4g} {self.unit}".rstrip()

    @property
    def text(self) -> str:
        """Value and unit as text."""
        return f"{number(self.value, self.digits)} {self.unit}".rstrip()


@dataclass(frozen=True)
class Table:
    """A titled table; cells are texts or numbers."""

    title: str
    header: tuple[str, ...]
    rows: list[tuple]
    note: str = ""


@dataclass(frozen=True)
class Plot:
    """A titled drawing as SVG."""

    title: str
    svg: str
    caption: str = ""


@dataclass
class Result:
    """Result of one experiment.

    ground: what was run, and on which robot; parts: tables and plots in reading order; bag: the recording that was evaluated,
    empty for the virtual robot; failures: why parts of the experiment could not be run.
    """

    name: str
    title: str
    question: str
    ground: str
    figures: list[Figure]
    parts: list[Table | Plot] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    bag: str = ""
    failures: list[str] = field(default_factory=list)

    @property
    def file(self) -> str:
        """Name of the page and JSON files, without suffix."""
        return f"{self.name}-recorded" if self.bag else self.name

    @property
    def command(self) -> str:
        """Command that makes this result, without `./gravcomp`."""
        return f"reproduce {self.name} --bag {self.bag}" if self.bag else f"reproduce {self.name}"

    @property
    def reached(self) -> bool:
        """Whether every figure with a limit reaches it."""
        return all(figure.reached is not False for figure in self.figures)

    def to_mapping(self) -> dict:
        """Return the result as data for JSON; numbers that are not finite become None."""
        figures = [
            {
                "name": f.name, "value": f.value, "unit": f.unit, "article": f.article, "target": f.target, "reached": f.reached,
            }
            for f in self.figures
        ]  # fmt: skip
        tables = [dataclasses.asdict(part) for part in self.parts if isinstance(part, Table)]
        return plain(
            {
                "name": self.name,
                "title": self.title,
                "ground": self.ground,
                "reached": self.reached,
                "seconds": self.seconds,
                "figures": figures,
                "tables": tables,
                "data": self.data,
                "parameters": self.parameters,
                "notes": self.notes,
                "failures": self.failures,
            }
        )


def number(value: Any, digits: int = 3) -> str:
    """Format a number with `digits` significant digits, with an exponent only below 1e-3 and from 1e5.

    >>> number(0.012345), number(123.456, 4), number(2.0e-5), number(float("nan"))
    ('0.0123', '123.5', '2.00e-05', '–')
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    if isinstance(value, int):
        return str(value)
    value = float(value)
    if not math.isfinite(value):
        return "–"
    if value != 0.0 and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits - 1}e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value)))) if value else 0
    return f"{value:.{min(decimals, 6)}f}"


def plain(value: Any) -> Any:
    """Convert a value to types that JSON has; arrays become lists, numbers that are not finite None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
