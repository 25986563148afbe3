"""Which figures of a benchmark are told first, and what each is to reach."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gravcomp.report.result import Figure


@dataclass(frozen=True)
class Row:
    """A figure at `key` of a benchmark's result (dots lead into it; of a list, its length), and its limit."""

    key: str
    name: str
    unit: str
    limit: float | None = None
    at_least: bool = False


ROWS = {
    "engine": (
        Row("calculix_error_pct", "worst tip error against every row of the CalculiX table, of the length", "%", 0.2),
        Row("full_step_ms.median", "full model, one closed-loop step (model, cables, inverse), median", "ms", 5.0),
        Row("reduced_step_ms.median", "reduced model, the same, median", "ms", 0.3),
        Row("reduced_step_ms.p99", "reduced model, the same, 99th percentile", "ms", 1.0),
        Row("reduced_error_mm", "reduced against full in the closed loop, 10 and 90 deg/s, worst tip", "mm", 0.05),
        Row("tet4_step_ms.median", "the article's mesh of linear tetrahedra, the same step, median", "ms"),
        Row("speedup_over_tet4", "full model faster than it by the factor", ""),
        Row("tet4_sag_mm", "its tip, released and horizontal", "mm"),
        Row("full_sag_mm", "the full model's", "mm"),
        Row("scaling.elements_along_exponent", "cost over elements along the robot, exponent", "", 1.3),
        Row("scaling.cables_exponent", "cost over cables, exponent", ""),
        Row("inverse_lateral_mm.median", "lateral tip error after compensation, 200 directions, median", "mm", 0.05),
        Row("inverse_lateral_mm.worst", "the same, worst", "mm", 0.15),
        Row("inverse_tilt_deg.worst", "tilt with direction weight, worst", "deg", 0.3),
        Row("inverse_lateral_with_direction_mm.worst", "lateral error with it, worst", "mm"),
        Row("inverse_shortening_mm.worst", "shortening by the cables, worst", "mm"),
        Row("extreme_step_ms", "targets that no shape has, then the straight one again: longest step of the model", "ms"),
        Row("extreme_back_mm", "the same: how far the tip is 6 s later from where it would be without, worst", "mm"),
        Row("inverse_us.median", "inverse problem, median", "us", 100.0),
        Row("inverse_us.p99", "inverse problem, 99th percentile", "us", 300.0),
        Row("dynamics_error_mm", "free fall at steps of 10 ms against 0.5 ms, reduced model, worst tip", "mm", 1.0),
        Row("dynamics_step_ms.median", "one such step, median", "ms", 0.5),
    ),
    "estimator": (
        Row("broad_deg", "inclination, mean RMSE of five BROAD trials, 95.2 Hz and full rate, the larger", "deg", 0.37),
        Row("broad_biased_deg", "with 1 deg/s of bias and a warm-up drift added", "deg"),
        Row("rest_jitter_deg", "jitter of gravity at rest, RMS", "deg", 0.02),
        Row("prediction.without_deg", "gravity 21 ms later, without prediction", "deg"),
        Row("prediction.with_deg", "the same, predicted", "deg"),
        Row("us_per_sample", "cost of a sample", "us", 150.0),
        Row("thermal.settled_s", "temperature from 20 degC, settled within 0.5 degC", "s", 120.0),
        Row("thermal.overshoot_degc", "its overshoot", "degC", 2.0),
        Row("ablation.static.filter_heating.yaw_drift_deg", "yaw over 9 min, at rest", "deg", 2.0),
        Row("ablation.rotating_23_deg_s.filter_heating.yaw_drift_deg", "yaw over 9 min, turning at 23 deg/s", "deg", 2.0),
        Row("ablation.rotating_23_deg_s.filter_no_heating.yaw_drift_deg", "the same without heating", "deg"),
        Row("ablation.rotating_23_deg_s.no_filter_heating.yaw_drift_deg", "the same without the filter", "deg"),
    ),
    "graph": (
        Row("delay_ms.median", "IMU frame to the current frame that it caused, median", "ms", 8.0),
        Row("delay_ms.p99", "the same, 99th percentile", "ms", 25.0),
        Row("bridge_cpu", "bridge with six motors at 500 Hz feedback, share of a core", "", 0.5),
        Row(
            "two_robots_hz.slower",
            "two robots at 100 Hz on this machine: commands followed a second, the slower one",
            "Hz",
            99.0,
            True,
        ),
    ),
    "page": (
        Row("drawn_s", "page drawn after the start of all nodes, in an open browser", "s", 5.0),
        Row("updates_hz", "updates that the page is sent", "Hz", 19.0, True),
        Row("animation_hz", "what the browser draws here", "Hz"),
        Row("delay_ms.without.median", "the loop's delay without a viewer, median", "ms"),
        Row("delay_ms.served.median", "with a viewer that nobody looks at, median", "ms"),
        Row("delay_ms.looked_at.median", "with a page that is looked at on this machine, median", "ms"),
        Row("delay_ms.without.p99", "without a viewer, 99th percentile", "ms"),
        Row("delay_ms.served.p99", "with a viewer that nobody looks at, 99th percentile", "ms"),
        Row("delay_ms.looked_at.p99", "with a page that is looked at on this machine, 99th percentile", "ms", 25.0),
    ),
    "faults": (
        Row("frames", "hostile frames and messages", "", 1_000_000, True),
        Row("crashes", "crashes", "", 0),
        Row("limit_violations", "currents beyond the limit on the bus", "", 0),
        Row("kills", "processes killed and restarted", ""),
        Row("not_recovered", "of them not followed again within 5 s by themselves", "", 0),
        Row("not_safe", "faults without a safe answer", "", 0),
        Row("not_back", "faults after which commands were not followed again", "", 0),
        Row("worst_safe_ms", "fault to safe current, worst", "ms", 250.0),
        Row("safe_ms.stop", "stop to zero current", "ms", 20.0),
    ),
    "soak": (
        Row("minutes", "length", "min", 30.0, True),
        Row("commands", "commands", ""),
        Row("lost_commands", "lost commands", "", 0),
        Row("worst_growth_mb", "growth of memory after warm-up, the process that grows most", "MB", 2.0),
        Row("limit_violations", "currents beyond the limit on the bus", "", 0),
    ),
}


def figures(benchmark: str, measured: Mapping[str, Any]) -> list[Figure]:
    """The benchmark's figures with their limits; those that were not measured here are left out."""
    found = []
    for row in ROWS[benchmark]:
        value: Any = measured
        for part in row.key.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        value = len(value) if isinstance(value, list) else value
        if value is not None:
            found.append(Figure(row.name, value, row.unit, limit=row.limit, at_least=row.at_least))
    return found
