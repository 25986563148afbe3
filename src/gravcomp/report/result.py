"""What an experiment hands over: figures beside the article's, tables, plots, parameters; as plain data for JSON and for the page."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Figure:
    """One figure of merit. `article`: what the article reports, in words; `limit` with `at_least`: what is to be reached, or None."""

    name: str
    value: float
    unit: str
    article: str = ""
    limit: float | None = None
    at_least: bool = False
    digits: int = 3

    @property
    def reached(self) -> bool | None:
        """Whether the limit is kept; None without one. NaN reaches nothing."""
        if self.limit is None:
            return None
        return bool(self.value >= self.limit if self.at_least else self.value <= self.limit)

    @property
    def target(self) -> str:
        """The limit in words."""
        if self.limit is None:
            return ""
        return f"{'≥' if self.at_least else '≤'} {self.limit:g} {self.unit}".rstrip()

    @property
    def text(self) -> str:
        """Value and unit."""
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
    """One experiment. `ground` says what was run and what stood for the real robot; `parts` are tables and plots in reading order; `bag`: the
    recording that was judged in place of the virtual robot.
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

    @property
    def file(self) -> str:
        """The name of its page's and JSON's files, without their ending."""
        return f"{self.name}-recorded" if self.bag else self.name

    @property
    def command(self) -> str:
        """What makes it."""
        return f"reproduce {self.name} --bag {self.bag}" if self.bag else f"reproduce {self.name}"

    @property
    def reached(self) -> bool:
        """Whether every figure with a limit reaches it."""
        return all(figure.reached is not False for figure in self.figures)

    def to_mapping(self) -> dict:
        """Plain data; numbers that are not finite become None, as JSON has no others."""
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
            }
        )


def number(value: Any, digits: int = 3) -> str:
    """A number for people: `digits` significant ones, no exponent where it can be read without."""
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
    """The value out of types that JSON knows."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
