"""Bias of the gyroscope over temperature: learned at rest while the chip warms up, saved, and subtracted from the next start on.

The model holds the mean bias at each degree; a polynomial by weighted least squares interpolates,

    b(T) = c0 + c1 (T - T0) + c2 (T - T0)^2,

with an order that depends on the learned span of temperature; beyond the span the value at its end holds.
"""

import json
import math
import os
import tempfile
from pathlib import Path

import numpy as np

FORMAT = "gravcomp bias over temperature 1"
LINEAR_FROM = 3.0  # degC of span
QUADRATIC_FROM = 12.0  # degC of span
MEMORY = 60.0  # s: largest weight of the values at one degree, so that the model follows an ageing sensor
RESIDUAL_STD = math.radians(0.1)  # rad/s: error of the model, from start to start


class BiasModelError(ValueError):
    """A file that is not a bias model; the text names the file."""


class BiasTemperatureModel:
    """Bias (rad/s) as a function of temperature (degC)."""

    def __init__(self) -> None:
        """Start with nothing learned."""
        self._bins: dict[int, tuple[float, float, np.ndarray]] = {}  # degree -> weight s, mean degC, mean bias (3,)
        self._coefficients: np.ndarray | None = None  # (order + 1, 3)

    @property
    def span(self) -> tuple[float, float] | None:
        """Lowest and highest learned temperature, degC; None where nothing is learned."""
        means = [mean for _, mean, _ in self._bins.values()]
        return (min(means), max(means)) if means else None

    def learn(self, temperature: float, bias: np.ndarray, duration: float) -> None:
        """Take a bias (3,) rad/s that was measured at rest for `duration` s at this temperature (degC)."""
        key = round(temperature)
        measured = np.asarray(bias, float)
        weight, mean, mean_bias = self._bins.get(key, (0.0, temperature, measured))
        gain = duration / (min(weight, MEMORY) + duration)
        self._bins[key] = (
            min(weight + duration, MEMORY),
            mean + gain * (temperature - mean),
            mean_bias + gain * (measured - mean_bias),
        )
        self._coefficients = None

    def bias(self, temperature: float) -> np.ndarray | None:
        """Return the bias (3,) rad/s at this temperature (degC); None where nothing is learned."""
        span = self.span
        if span is None:
            return None
        if self._coefficients is None:
            self._coefficients = self._fit(span)
        offset = min(max(temperature, span[0]), span[1]) - 0.5 * (span[0] + span[1])
        return offset ** np.arange(len(self._coefficients)) @ self._coefficients

    def merge(self, other: "BiasTemperatureModel") -> None:
        """Take the values of the other model with their weights."""
        for weight, mean, bias in other._bins.values():
            self.learn(mean, bias, weight)

    def clear(self) -> None:
        """Remove all values."""
        self._bins.clear()
        self._coefficients = None

    def save(self, path: str | Path) -> None:
        """Write the file atomically: a reader finds either the old or the new one."""
        path = Path(path).expanduser()
        path.parent.mkdir(parents=True, exist_ok=True)
        rows = [
            {"temperature_c": mean, "weight_s": weight, "bias_deg_s": np.degrees(bias).tolist()}
            for _, (weight, mean, bias) in sorted(self._bins.items())
        ]
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump({"format": FORMAT, "bins": rows}, file, indent=1)
        os.replace(temporary, path)

    @classmethod
    def load(cls, path: str | Path) -> "BiasTemperatureModel":
        """Return the model in the file, an empty one where the file does not exist. Raises BiasModelError for another file."""
        path = Path(path).expanduser()
        model = cls()
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != FORMAT:
                raise ValueError(f"format '{content['format']}'")
            for row in content["bins"]:
                bias = np.radians(np.array(row["bias_deg_s"], float))
                values = (float(row["weight_s"]), float(row["temperature_c"]), bias)
                if bias.shape != (3,) or not np.isfinite([*values[:2], *bias]).all():
                    raise ValueError("an entry is not three finite numbers")
                model._bins[round(values[1])] = values
        except FileNotFoundError:
            return model
        except OSError as error:
            raise BiasModelError(f"{path}: cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise BiasModelError(f"{path}: is not a bias model: it is not a UTF-8 text file") from error
        except (ValueError, KeyError, TypeError) as error:
            raise BiasModelError(f"{path}: is not a bias model ({error}); delete it to learn the bias again") from error
        return model

    def _fit(self, span: tuple[float, float]) -> np.ndarray:
        order = 0 if span[1] - span[0] < LINEAR_FROM else 1 if span[1] - span[0] < QUADRATIC_FROM else 2
        order = min(order, len(self._bins) - 1)
        weight, mean, bias = (np.array(column) for column in zip(*self._bins.values()))
        powers = (mean - 0.5 * (span[0] + span[1]))[:, None] ** np.arange(order + 1)
        root = np.sqrt(weight)[:, None]
        return np.linalg.lstsq(powers * root, bias * root, rcond=None)[0]
