"""Headline figures of the benchmarks, with their limits."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gravcomp.report.result import Figure


@dataclass(frozen=True)
class Row:
    """A headline figure and its limit.

    key: path in the benchmark's result, with dots; of a list, its length counts; `*` stands for every key of a mapping, which
    the figure's name then has in front. optional: a value None means that there is nothing to measure, and there is no row.
    """

    key: str
    name: str
    unit: str
    limit: float | None = None
    at_least: bool = False
    optional: bool = False


ROWS = {
    "engine": (
        Row("calculix_error_pct", "tip error against CalculiX, share of the length, worst row", "%", 0.2),
        Row("full_step_ms.median", "full model: one closed-loop step (model, cables, inverse problem), median", "ms", 5.0),
        Row("reduced_step_ms.median", "reduced model: one closed-loop step, median", "ms", 0.3),
        Row("reduced_step_ms.p99", "reduced model: one closed-loop step, 99th percentile", "ms", 1.0),
        Row("reduced_error_mm", "reduced against full model in the closed loop at 10 and 90 deg/s, worst tip error", "mm", 0.05),
        Row("neo_hookean.reduced_step_ms.median", "the same with the neo-Hookean law: one closed-loop step, median", "ms", 0.3),
        Row("neo_hookean.reduced_step_ms.p99", "the same with the neo-Hookean law: 99th percentile", "ms", 1.0),
        Row("neo_hookean.reduced_error_mm", "the same with the neo-Hookean law: worst tip error", "mm", 0.05),
        Row("tet4_step_ms.median", "linear tetrahedra as in the article: one closed-loop step, median", "ms"),
        Row("speedup_over_tet4", "speed-up of the full model over the linear tetrahedra", ""),
        Row("tet4_sag_mm", "linear tetrahedra: deflection of the tip, released and horizontal", "mm"),
        Row("full_sag_mm", "full model: deflection of the tip, released and horizontal", "mm"),
        Row("scaling.elements_along_exponent", "exponent of the cost over elements along the robot", "", 1.3),
        Row("scaling.cables_exponent", "exponent of the cost over cables", ""),
        Row("inverse_lateral_mm.median", "lateral tip error after compensation, 200 directions, median", "mm", 0.05),
        Row("inverse_lateral_mm.worst", "lateral tip error after compensation, 200 directions, worst", "mm", 0.15),
        Row("inverse_tilt_deg.worst", "tilt with a direction weight, worst", "deg", 0.3),
        Row("inverse_lateral_with_direction_mm.worst", "lateral tip error with a direction weight, worst", "mm"),
        Row("inverse_shortening_mm.worst", "shortening by the cables, worst", "mm"),
        Row("extreme_step_ms", "unreachable targets, then the straight one: longest step of the model", "ms"),
        Row("extreme_back_mm", "unreachable targets, then the straight one: tip error caused after 6 s, worst", "mm"),
        Row("inverse_us.median", "inverse problem, median", "us", 100.0),
        Row("inverse_us.p99", "inverse problem, 99th percentile", "us", 300.0),
        Row("dynamics_error_mm", "free fall of the reduced model: steps of 10 ms against 0.5 ms, worst tip error", "mm", 1.0),
        Row("dynamics_step_ms.median", "free fall of the reduced model: one step, median", "ms", 0.5),
    ),
    "board": (
        Row("board_frames", "hostile frames and samples, at the emulated image and the C code each", "", 200_000, at_least=True),
        Row("board_violations", "violations of what must hold", "", 0),
        Row("board_faults", "faults of the processor, resets, reports of the sanitizers", "", 0),
        Row("image_differences", "ticks in which image and C code sent different frames", "", 0),
        Row("dead_host_ms", "from the last currents of a dead host to zero current, worst", "ms", 100),
        Row("heater_off_s", "from a failed sensor to the heater off, worst", "s", 2.0),
        Row("build_s", "building the image, with the loop on the board", "s", 30.0),
        Row("image_identical", "the image is the same twice", "", 1, at_least=True),
        Row("image_flash_kb", "flash of the image", "KB"),
        Row("image_ram_kb", "RAM of the image", "KB"),
        Row("image_stack_kb", "stack of the image, bound", "KB", 8.0),
        Row(
            "board_tip_mm",
            "loop on the board in float32 against the host's at 10 and 90 deg/s, worst tip of the model",
            "mm",
            0.05,
        ),
        Row("board_command_mm", "the same, worst cable command", "mm", 0.05),
        Row("board_ms.p50", "step of the loop on the board, estimated at 168 MHz, median", "ms", 7.0),
        Row("board_ms.worst", "step of the loop on the board, estimated at 168 MHz, worst", "ms", 10.0),
        Row("board_deg", "estimator on the board against the host's on BROAD, worst angle of gravity", "deg", 0.05),
        Row("flash_kb", "flash with the loop on the board and its model", "KB", 900.0),
        Row("ram_kb", "RAM with the loop on the board", "KB", 160.0),
        Row("stack_kb", "largest stack with the loop on the board", "KB", 8.0),
        Row(
            "emulated_residual_pct",
            "lateral residual with the C code as board, more than with the Python board, the worse of at rest and turning",
            "%",
            5.0,
        ),
        Row("standalone_residual_pct", "the same with the loop on the board", "%", 5.0),
        Row("residual_pct.*.held", "lateral residual at rest, more than with the Python board", "%"),
        Row("residual_pct.*.moving", "lateral residual turning, more than with the Python board", "%"),
        Row("robots.*.tip_mm", "loop on the board against the host's, worst tip of the model", "mm"),
        Row("robots.*.lateral_mm", "the same, across the robot", "mm"),
        Row("robots.*.command_mm", "the same, worst cable command", "mm"),
        Row("robots.*.basis_error_mm", "tip with the basis that fits against that with all modes, worst", "mm"),
        Row("robots.*.ms", "step of the loop on the board, estimated at 168 MHz, worst", "ms", 10.0),
    ),
    "contact": (
        Row("contact_error_pct", "tip and force of contact against closed forms and CalculiX, worst", "%", 0.5),
        Row("penetration_mm", "deepest place in a rigid wall, 200 seeded scenes with motion", "mm", 0.02),
        Row("contact_step_ms", "reduced model with inverse problem, in contact, median", "ms", 0.5),
        Row("contact_energy", "energy gained from contact over a closed path, share of the weight's work, worst scene", "", 1e-3),
        Row("lost_steps", "steps without an equilibrium, share", ""),
        Row("rod_tip_pct.median", "tip against the virtual robot's rod in seeded scenes, share of the length, median", "%"),
        Row("rod_tip_pct.worst", "the same, worst scene", "%"),
        Row("rod_force_pct.median", "force of the walls against the virtual robot's rod, share of it, median", "%"),
        Row("rod_force_pct.worst", "the same, worst scene", "%"),
        Row("wrong_scene_said", "wall 2 mm off the scene's: cases that say so, share", "", 1, at_least=True),
        Row("right_scene_said", "wall where the scene has it: cases that say it is not, share", "", 0),
        Row("wrong_scene_ripple_mm", "wall 2 mm off the scene's or where it has it: motion of the tip at rest, worst", "mm", 0.5),
        Row("self_contact_depth_mm", "deepest place of a coiled robot in itself", "mm", 0.02),
        Row("self_contact_energy", "energy gained from itself over a closed path, share of the cable's work", "", 1e-3),
        Row("self_contact_force_pct", "force of the robot on itself against the virtual robot's rod, worst", "%"),
        Row("self_contact_tip_pct", "tip of the coiled robot against the virtual robot's rod, share of the length, worst", "%"),
        Row("free_tip_pct", "the same before it touches itself", "%"),
        Row("unsolved_scenes", "scenes of 200 that are not entered from the straight robot", ""),
        Row("lumen_penetration_mm", "deepest place in a lumen from a mesh, 20 of these scenes", "mm", 0.02),
        Row("lumen_lost_steps", "steps without an equilibrium in lumens from meshes, share", ""),
        Row("unsolved_lumens", "lumens from meshes that are not entered from the straight robot, of 20", ""),
    ),
    "robots": (
        Row("robots.*.mesh_error_pct", "tip against a mesh twice as fine, share of the length", "%", 0.1),
        Row("robots.*.rest_error_pct", "tip without load and gravity, share of the length", "%", 1e-7),
        Row("robots.*.reduced_step_ms", "step of the reduced model with the inverse problem, median", "ms", 0.3),
        Row("robots.*.reduced_error_pct", "reduced against full model in the closed loop, worst", "%", 0.05),
        Row("robots.*.build_s", "from the file to the reduced model, one core", "s", 60.0),
        Row("robots.article.reduced_step_ms", "article: step of the reduced model with the inverse problem, median", "ms", 0.11),
        Row("robots.*.uncalibrated_pct", "lateral residual held, of the released sag, worst seed", "%", 8.0),
        Row("robots.*.uncalibrated_moving_pct", "the same while the base turns at 30 deg/s", "%"),
        Row("robots.*.calibrated_pct", "lateral residual held, calibrated, of the released sag, worst seed", "%", 2.0),
        Row("robots.article.calibrated_pct", "article: lateral residual held, calibrated, of the released sag", "%", 1.0),
        Row("robots.*.moving_pct", "the same, calibrated, while the base turns at 30 deg/s", "%", 4.0),
        Row("robots.*.modulus_error_pct", "error of a segment's calibrated modulus, worst", "%", 2.0),
        Row(
            "robots.*.compliance_error_pct", "error of a cable's calibrated compliance, where it shows", "%", 10.0, optional=True
        ),
        Row("robots.*.calibrate_s", "robot time of a calibration", "s", 180.0),
        Row("robots.*.similarity_pct", "robots of 0.5 to 4 times the size, largest difference", "%", 2.0, optional=True),
        Row("ccx_error_pct", "against CalculiX, worst row, share of the length", "%", 0.2),
        Row("disks_error_pct", "backbones with disks, worst, share of the length", "%", 0.3),
        Row("rod_error_pct", "rod under gravity and wrenches, worst, share of the length", "%", 0.3),
        Row("beam_rest_mm", "beam at rest under load, worst marker", "mm", 0.8),
        Row("beam_motion_mm", "beam in motion, RMS", "mm", 2.5),
        Row("tentacle_mm", "tentacle, fitted", "mm", 8.0),
        Row("tentacle_held_mm", "tentacle, each pose predicted by a fit to the others", "mm", 12.0),
        Row("tdcr_mm", "nine tendons, five-fold", "mm", 4.0),
        Row("coverage_pct", "95 % intervals of a calibration with the truth in them, worst kind", "%", 90.0, at_least=True),
        Row("coverage_width", "half width of these intervals over the deviation of the errors, widest kind", "", 4.0),
    ),
    "track": (
        Row("robots.*.untracked_mm", "held, modulus 15 % off and strong creep, without tracker: lateral RMS, worst", "mm"),
        Row("robots.*.tracked_mm", "the same with a tracker: lateral RMS, worst", "mm"),
        Row("robots.*.tracked_pct", "the same, share of the released sag", "%"),
        Row("robots.article.tracked_mm", "article: held with a tracker, lateral RMS, worst", "mm", 0.3),
        Row("robots.*.untracked_moving_mm", "base turning at 30 deg/s, without tracker: lateral RMS, worst", "mm"),
        Row("robots.*.tracked_moving_mm", "base turning at 30 deg/s, with a tracker: lateral RMS, worst", "mm"),
    ),
    "loads": (
        Row("wrench_error_pct", "rod under gravity and wrenches against SoRoSim: tip, worst, share of the length", "%", 0.3),
        Row("payload_error_pct", "unknown payload, found from tensions and tracker: error, worst", "%", 10.0),
        Row("payload_residual_mm", "the same: lateral tip error once it is found, RMS, worst", "mm", 1.0),
        Row("payload_outside", "payloads outside the interval that is reported, all sensors", "", 0.0),
        Row("payload_imu_frames", "IMU frames that a payload changes while an arm turns the base", ""),
        Row(
            "force_error_pct",
            "force across the tip, 0.05 to 0.5 N, not compensated, both sensors: error, worst",
            "%",
            20.0,
        ),
        Row("force_error_deg", "the same: error of its direction across the robot, worst", "deg", 15.0),
    ),
    "estimator": (
        Row("broad_deg", "inclination: mean RMSE of five BROAD trials, larger of 95.2 Hz and full rate", "deg", 0.37),
        Row("broad_biased_deg", "inclination: RMSE with 1 deg/s of bias and a warm-up drift added", "deg"),
        Row("rest_jitter_deg", "jitter of gravity at rest, RMS", "deg", 0.02),
        Row("prediction.without_deg", "gravity 21 ms ahead: error without prediction", "deg"),
        Row("prediction.with_deg", "gravity 21 ms ahead: error with prediction", "deg"),
        Row("us_per_sample", "CPU time of a sample", "us", 150.0),
        Row("thermal.settled_s", "temperature control from 20 degC: settled within 0.5 degC", "s", 120.0),
        Row("thermal.overshoot_degc", "temperature control from 20 degC: overshoot", "degC", 2.0),
        Row("ablation.static.filter_heating.yaw_drift_deg", "yaw drift over 9 min: at rest", "deg", 2.0),
        Row("ablation.rotating_23_deg_s.filter_heating.yaw_drift_deg", "yaw drift over 9 min: turning at 23 deg/s", "deg", 2.0),
        Row(
            "ablation.rotating_23_deg_s.filter_no_heating.yaw_drift_deg", "yaw drift over 9 min: turning, without heating", "deg"
        ),
        Row(
            "ablation.rotating_23_deg_s.no_filter_heating.yaw_drift_deg",
            "yaw drift over 9 min: turning, without the filter",
            "deg",
        ),
    ),
    "streams": (
        Row("false_reports", "clean trials: findings", "", 0.0),
        Row("missed.*", "trials in which it is not reported", "", 0.0),
        Row("beyond_limit_deg.*", "error beyond the limit", "deg", 0.0),
        Row("excess_deg.gyro_spikes", "gyroscope spikes: error beyond the clean trial's, worst", "deg", 0.25),
        Row("excess_deg.accel_spikes", "accelerometer spikes: error beyond the clean trial's, worst", "deg", 0.25),
        Row("partly_calibrated", "scale and offset: trials that turn too little to be calibrated, which is reported", ""),
        Row("partly_calibrated_deg", "the same: error beyond the clean trial's, worst", "deg", 0.5),
        Row("simulated.false_reports", "simulated sensors and motions, clean: findings", "", 0.0),
        Row("simulated.missed.*", "simulated sensors and motions: recordings in which it is not reported", "", 0.0),
        Row("simulated.excess_deg.gyro_spikes.*", "simulated: gyroscope spikes, error beyond the clean recording's", "deg", 0.25),
        Row("simulated.excess_deg.accel_spikes.*", "simulated: accelerometer spikes, error beyond the clean's", "deg", 0.25),
        Row("simulated.after_gap_sigmas.*", "simulated: largest error after a gap, in standard deviations", "", 3.0),
        Row("us_per_sample", "CPU time of the live checks, a sample", "us", 20.0),
    ),
    "graph": (
        Row("delay_ms.median", "delay from IMU frame to the current frame that it caused, median", "ms", 8.0),
        Row("delay_ms.p99", "delay from IMU frame to the current frame that it caused, 99th percentile", "ms", 25.0),
        Row("composed.delay_ms.median", "the same with the inner nodes in one process, median", "ms"),
        Row("composed.less_pct.median", "delay with the inner nodes in one process, by how much less, median", "%", 30.0, True),
        Row("composed.less_pct.within", "the same: half the width of the interval in which it is known", "%"),
        Row("composed.commands_hz", "commands followed with the inner nodes in one process, slowest run", "Hz", 99.0, True),
        Row("bridge_cpu", "CPU load of the bridge with six motors at 500 Hz feedback, share of a core", "", 0.5),
        Row(
            "two_robots_hz.slower",
            "two robots at 100 Hz on this machine: followed commands per second, slower robot",
            "Hz",
            99.0,
            True,
        ),
    ),
    "page": (
        Row("drawn_s", "page drawn in an open browser after the start of all nodes", "s", 5.0),
        Row("updates_hz", "updates sent to the page", "Hz", 19.0, True),
        Row("animation_hz", "frames drawn by the browser", "Hz"),
        Row("delay_ms.without.median", "delay of the loop without a viewer, median", "ms"),
        Row("delay_ms.served.median", "delay of the loop with a viewer, page not open, median", "ms"),
        Row("delay_ms.looked_at.median", "delay of the loop with the page open on this machine, median", "ms"),
        Row("delay_ms.without.p99", "delay of the loop without a viewer, 99th percentile", "ms"),
        Row("delay_ms.served.p99", "delay of the loop with a viewer, page not open, 99th percentile", "ms"),
        Row("delay_ms.looked_at.p99", "delay of the loop with the page open on this machine, 99th percentile", "ms", 25.0),
    ),
    "faults": (
        Row("frames", "hostile frames and messages", "", 1_000_000, True),
        Row("crashes", "crashes", "", 0),
        Row("limit_violations", "current frames beyond the limit", "", 0),
        Row("kills", "processes killed and restarted", ""),
        Row("not_recovered", "kills without automatic recovery within 5 s", "", 0),
        Row("not_safe", "faults without a safe response", "", 0),
        Row("not_back", "faults after which commands were not followed again", "", 0),
        Row("worst_safe_ms", "time from fault to safe current, worst", "ms", 250.0),
        Row("safe_ms.stop", "time from stop to zero current", "ms", 20.0),
    ),
    "joints": (
        Row("messages", "hostile messages to joint_bridge", "", 1_000_000, True),
        Row("violations", "messages to the controller beyond a limit", "", 0),
        Row("over_can_pct.trajectory.held_mm", "trajectory controller: error at rest over that on CAN", "%", 10.0),
        Row("over_can_pct.trajectory.moving_mm", "trajectory controller: error in motion over that on CAN", "%", 10.0),
        Row("over_can_pct.position.held_mm", "position controller: error at rest over that on CAN", "%", 10.0),
        Row("over_can_pct.position.moving_mm", "position controller: error in motion over that on CAN", "%", 10.0),
        Row("over_can_pct.effort.held_mm", "effort controller: error at rest over that on CAN", "%", 10.0),
        Row("over_can_pct.effort.moving_mm", "effort controller: error in motion over that on CAN", "%"),
    ),
    "start": (
        Row("first_page_s", "clone to the moving page with empty caches, without the downloads", "s", 90.0),
        Row("download_s", "downloads of the first start", "s"),
        Row("later_page_s", "second start: until the page moves", "s", 3.0),
        Row("later_loop_s", "second start: until the loop is closed", "s", 5.0),
        Row("nodes_active_s", "start of the nodes until all are active, caches warm", "s", 2.5),
        Row("venv_mb", "size of .venv", "MB", 600.0),
        Row("command_ms.version", "`./gravcomp --version`", "ms", 300.0),
        Row("command_ms.model_help", "`./gravcomp model --help`", "ms", 300.0),
        Row("test_s", "all tests", "s", 480.0),
        Row("test_fast_s", "unit tests of the core", "s", 90.0),
    ),
    "soak": (
        Row("minutes", "duration", "min", 30.0, True),
        Row("commands", "commands", ""),
        Row("lost_commands", "lost commands", "", 0),
        Row("worst_growth_mb", "memory growth after warm-up, worst process", "MB", 2.0),
        Row("limit_violations", "current frames beyond the limit", "", 0),
    ),
}


def figures(benchmark: str, measured: Mapping[str, Any]) -> list[Figure]:
    """Return the headline figures of a benchmark with their limits, without those that were not measured.

    A figure of a robot that failed is NaN, which reaches no limit.
    """
    found = []
    for row in ROWS[benchmark]:
        for name, value in _values(row, measured):
            found.append(Figure(name, value, row.unit, limit=row.limit, at_least=row.at_least))
    return found


def _values(row: Row, measured: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Names and values of the row's figures."""
    before, star, after = row.key.partition(".*")
    if not star:
        value = _value(measured, row.key)
        return [] if value is None else [(row.name, value)]
    found, own = [], after.removeprefix(".")
    for key, entry in (_value(measured, before) or {}).items():
        if not own or own in entry:
            value = entry[own] if own else entry
            if value is None and row.optional and "errors" not in entry:
                continue
            found.append((f"{key}: {row.name}", math.nan if value is None else value))
    return found


def _value(measured: Mapping[str, Any], key: str) -> Any:
    """The value at a path with dots, the length of a list; None where there is none."""
    value: Any = measured
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return len(value) if isinstance(value, list) else value
