"""The loop on the board: its C code in float32 against the host's loop in double precision, its time, memory and estimator."""

from collections.abc import Callable

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import RobotFile, load_robot_file
from gravcomp.description.robot_file import shipped_robots
from gravcomp.firmware.cycles import Cycles, loop_cycles, sample_bytes
from gravcomp.firmware.emulator.machine import STACK_SIZE
from gravcomp.firmware.image import build_image
from gravcomp.firmware.loop_on_host import APPROACH_STEPS, LOADING_STEPS, run_on_host, turning_gravity
from gravcomp.firmware.model_fit import Fit, fit
from gravcomp.firmware.model_settings import SAMPLE_PERIOD, LoopParameters
from gravcomp.firmware.stack import largest_stack
from gravcomp.firmware.standalone_loop import StandaloneLoop
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.orientation import GravityEstimator
from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.offline import estimate_recording
from gravcomp.recordings.imu import Recording
from gravcomp.recordings.imu.broad_folder import broad_trials
from gravcomp.reduction import load
from gravcomp.training import build

Progress = Callable[[str], None]

_RUBBER = "tentacle"
_RATES, _SEEDS = (10.0, 90.0), 3  # deg/s
_STEPS = 400
_SMOOTHED = 15  # steps on either side of one
_COUNTED, _BRIEFLY_COUNTED = 12, 3  # steps of which the cycles are counted; in a brief run
_PER_G, _GRAVITY = 5460.0, 9.80665  # counts of the range of 6 g
_COUNTS_PER_RAD_S = 32767.0 / np.radians(2000.0)


def run(progress: Progress, *, every: int = 1) -> dict:
    """Return all figures for the article's robot; `every`: of the paths, steps and trials only every so many."""
    file = load_robot_file("article")
    progress("model of the board")
    found = model_of(file)
    return {
        "board_modes": found.model.size,
        "board_model_kb": round(len(found.blob) / 1024, 1),
        "board_basis_error_mm": round(1e3 * found.error, 4),
        **accuracy(progress, file, found, every),
        **memory(progress, found),
        **step_time(progress, file, found, every, _COUNTED if every == 1 else _BRIEFLY_COUNTED),
        **estimator(progress, file, found, every),
        **({"robots": others(progress)} if every == 1 else {}),
    }


def others(progress: Progress) -> dict[str, dict]:
    """Return for the other shipped robots what their models cost on the board and how they compare, or why they do not fit.

    Of those whose reduced models are built (`bench robots` builds all), and of the first one that has a law of rubber.
    """
    found: dict[str, dict] = {}
    for name in shipped_robots():
        file = load_robot_file(name)
        if name == "article" or (name != _RUBBER and load(RobotModel(file.robot)) is None):
            continue
        progress(f"model of {name} on the board")
        try:
            own = model_of(file)
        except ConfigError as error:
            found[name] = {"refused": str(error)}
            continue
        compared = accuracy(progress, file, own, 2)
        found[name] = {
            "modes": own.model.size,
            "law_points": len(own.model.deviation.weight),
            "basis_error_mm": round(1e3 * own.error, 4),
            "tip_mm": compared["board_tip_mm"],
            "lateral_mm": compared["board_lateral_mm"],
            "command_mm": compared["board_command_mm"],
            "ms": step_time(progress, file, own, 4)["board_ms"]["worst"],
        }
    return found


def model_of(file: RobotFile) -> Fit:
    """Return the model of a robot that fits the board; its reduced model is built where there is none."""
    model = RobotModel(file.robot)
    reduction = load(model) or build(model)[0]
    return fit(model, reduction, LoopParameters.of(file))


def accuracy(progress: Progress, file: RobotFile, found: Fit, every: int = 1) -> dict:
    """Return the worst differences from the host's loop while gravity turns at 10 and 90 deg/s.

    `board_tip_mm`: of the model's tip, `board_lateral_mm`: of it across the straight robot, `board_command_mm`: of a cable's
    displacement, `board_solver_steps`: most of a programme.
    """
    model, parameters = RobotModel(file.robot), LoopParameters.of(file)
    tip = lateral = command = 0.0
    steps = 0
    for rate in _RATES:
        for seed in range(0, _SEEDS, every):
            progress(f"loop on the board at {rate:g} deg/s, path {seed + 1} of {_SEEDS}")
            gravities = turning_gravity(np.radians(rate), seed, _STEPS // every)
            host = run_on_host(model, parameters, gravities)
            loop = StandaloneLoop(found.blob)
            for _ in range(LOADING_STEPS - 1):
                loop.follow(SAMPLE_PERIOD, gravities[0])
            for step, (gravity, host_tip, host_command) in enumerate(zip(gravities, host.tip, host.command)):
                loop.follow(SAMPLE_PERIOD, gravity)
                result = loop.read()
                steps = max(steps, result.solver_steps)
                if step < APPROACH_STEPS:
                    continue
                apart = result.tip - host_tip
                tip = max(tip, float(np.linalg.norm(apart)))
                lateral = max(lateral, float(np.linalg.norm(apart[:2])))
                command = max(command, float(np.abs(result.displacement - host_command).max()))
    return {
        "board_tip_mm": round(1e3 * tip, 4),
        "board_lateral_mm": round(1e3 * lateral, 4),
        "board_command_mm": round(1e3 * command, 4),
        "board_solver_steps": steps,
    }


def memory(progress: Progress, found: Fit) -> dict:
    """Return `flash_kb` with the model, `ram_kb` with the stack, and `stack_kb`, of the image with the loop on the board."""
    progress("image with the loop on the board")
    image = build_image(standalone=True)
    stack = largest_stack(image)
    return {
        "flash_kb": round((image.flash + len(found.blob)) / 1024, 1),
        "ram_kb": round((image.ram + image.ccm + STACK_SIZE) / 1024, 1),
        "stack_kb": round(stack / 1024, 2),
    }


def step_time(progress: Progress, file: RobotFile, found: Fit, every: int = 1, counted: int = _COUNTED) -> dict:
    """Return `board_ms`: estimated time of a whole step at 168 MHz, median and worst, while gravity turns at 90 deg/s.

    every: more than 1: a path that is so many times shorter, and ends before gravity turns at its rate; counted: number of its
    last steps.
    """
    progress("cycles of a step on the emulated processor")
    path = _of_a_base(turning_gravity(np.radians(90.0), 0, 200))
    path = path[: len(path) // every]
    samples = [sample_bytes(*_counts(file, path, step), 1, 0) for step in range(1, len(path))]
    first = len(samples) - counted
    cycles = loop_cycles(build_image(standalone=True), found.blob, samples, first)
    times = np.array([of.milliseconds for of in cycles])
    return {
        "board_ms": {"p50": round(float(np.median(times)), 2), "worst": round(float(times.max()), 2)},
        "board_cycles": _largest(cycles[-1]),
    }


def _of_a_base(path: np.ndarray) -> np.ndarray:
    """Return the mean of a path of gravity (n, 3) over 0.3 s: jumps of the rate would have the forces of an impact."""
    whole = np.concatenate([[path[0]] * _SMOOTHED, path, [path[-1]] * _SMOOTHED])
    mean = np.array([np.convolve(column, np.full(2 * _SMOOTHED + 1, 1.0), mode="valid") for column in whole.T]).T
    return np.linalg.norm(path[0]) * _unit(mean)


def _largest(cycles: Cycles) -> dict[str, int]:
    parts = {"data of the flash": cycles.data_waits, "code of the flash": cycles.code_waits, **cycles.by_function}
    return dict(sorted(parts.items(), key=lambda item: -item[1])[:8])


def _counts(file: RobotFile, path: np.ndarray, step: int) -> tuple[list[int], int]:
    """Return six counts of the IMU at a step of a path of gravity (n, 3) in soft_base, and the stamp in us."""
    back = file.robot.imu_mount.rotation.T
    before, now = path[step - 1], path[step]
    turn = -np.cross(before, now) / (now @ now) / SAMPLE_PERIOD
    force, rate = back @ (-now) / _GRAVITY * _PER_G, back @ turn * _COUNTS_PER_RAD_S
    return [round(float(value)) for value in (*force, *rate)], round(1e6 * SAMPLE_PERIOD) * step


def estimator(progress: Progress, file: RobotFile, found: Fit, every: int = 1) -> dict:
    """Return `board_deg`: largest angle between the gravity of both estimators over BROAD's trials; None: there are none."""
    trials = broad_trials(every)
    worst: float | None = None
    for name, trial in trials.items():
        progress(f"estimator on the board, {name}")
        worst = max(worst or 0.0, gravity_difference(trial, file, found.blob))
    return {"board_deg": None if worst is None else round(float(np.degrees(worst)), 5), "board_trials": len(trials)}


def gravity_difference(recording: Recording, file: RobotFile, blob: bytes) -> float:
    """Return the largest angle in rad between the gravity that the board and the host estimate from a recording."""
    parameters = LoopParameters.of(file)
    mount = quat.from_roll_pitch_yaw(*file.robot.imu_mount.rpy)
    host = estimate_recording(recording, GravityEstimator(parameters.estimator.estimator, mount)).gravity
    loop = StandaloneLoop(blob)
    board = np.full_like(host, np.nan)
    for row, (stamp, gyro, accel) in enumerate(recording.samples()):
        loop.weigh((stamp + 500) // 1000, gyro, accel)
        board[row] = loop.gravity
    apart = _unit(board) - _unit(host)
    return float(np.nanmax(2.0 * np.arcsin(0.5 * np.linalg.norm(apart, axis=1))))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
