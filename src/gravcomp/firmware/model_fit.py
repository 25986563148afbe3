"""Which basis of a reduced model the board has room and time for, what it costs, and the error of a smaller one."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.config import ConfigError
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.firmware.cycles import CLOCK_HZ
from gravcomp.firmware.loop_on_host import LOADING_STEPS, HostRun, run_on_host, turning_gravity
from gravcomp.firmware.model_blob import (
    LAW_POINTS_MAX,
    MODES_MAX,
    PIECES_MAX,
    POINTS_MAX,
    STRAINS_MAX,
    TILE,
    VERSION,
    blob_bytes,
    pack,
)
from gravcomp.firmware.model_settings import BRANCHES_MAX, SAMPLE_PERIOD, LoopParameters, least_tensions, settings
from gravcomp.firmware.standalone_loop import StandaloneLoop
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.reduction.memory import Memory
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.store import Reduction, load, why_not
from gravcomp.reduction.tracking import ReducedTracker
from gravcomp.whole_file import write_whole

SLOT_BYTES = 384 * 1024
"""Room for a blob in the flash of the STM32F407 (boards/stm32f407/image.ld)."""

LONGEST_MS = 7.0
"""For a step, of the 10 ms between two samples; the rest is for interrupts, and for what the estimate may lack."""

_EXTRA = (36, 16, 8, 4, 0)
"""Principal strains in addition to those of the modes, in the order in which they are tried."""

# Cycles of the Cortex-M4 for one multiply-add of each part, with its loads and the wait states of the flash; measured on the
# emulated image (`bench board`).
_CYCLES = {"elasticity": 4.1, "cables": 8.4, "factor": 9.7, "answers": 6.1, "tension": 14.5, "law": 6.0}
_LAW_FORCE, _LAW_STIFFNESS = 150, 700  # multiply-adds at a point, whatever the number of modes
_LEAST_SHARE = 3  # points of a law: fewer make a stiffness of which half is older than a tenth of a second

# Filter, tip, compliance and inverse problem, which hardly depend on the basis; and for each cable.
_REST_CYCLES, _CYCLES_OF_A_CABLE = 191_000, 8_000


@dataclasses.dataclass(frozen=True)
class Fit:
    """A basis that fits: its model, bytes of the blob, multiply-adds of a step, estimated ms, and error in m.

    error: worst distance of the tip from that of the whole reduced model in the closed loop, with a law of rubber that of the
    loop on the board; reduction_error: of that from the full model, where it was built.
    """

    model: ReducedModel
    blob: bytes
    strains: int
    multiply_adds: int
    milliseconds: float
    error: float
    reduction_error: float


def fit(model: RobotModel, reduction: Reduction, parameters: LoopParameters, joystick_bend: float = np.pi / 3) -> Fit:
    """Return the basis with the smallest error that the board has room and time for, as a blob.

    joystick_bend: rad at full deflection of the joystick. Raises ConfigError, with the number, for a robot that does not fit.
    """
    whole = reduction.reduced_model(model)
    _check(whole, parameters)
    turn = BaseTurn(model, parameters.turn)
    run = run_on_host(model, parameters, turning_gravity(np.radians(90.0), 0, 200), rise=True)
    best: Fit | None = None
    for smaller, share in _candidates(whole):
        values = settings(parameters, smaller.reach, joystick_bend, turn, share)
        blob = pack(smaller, model.robot, values, least_tensions(parameters), _branches(model))
        error = error_of_loop(blob, whole, model, run) if share else _error(smaller, model, run)
        if best is None or error < best.error:
            strains = smaller.elasticity.linear.shape[1]
            best = Fit(smaller, blob, strains, *cost(smaller, share), error, reduction.error_worst)
    if best is None:
        raise ConfigError(_too_big(whole, parameters))
    if not np.isfinite(best.error):
        raise ConfigError(
            f"{parameters.source}: with none of the bases that take up to {LONGEST_MS:g} ms a step does the loop on the board"
            " follow gravity that turns at 90 deg/s"
        )
    return best


def reduction_for(model: RobotModel, source: str) -> Reduction:
    """Return the reduced model that is built for the robot of the file `source`. Raises ConfigError where there is none."""
    reduction = load(model)
    if reduction is None:
        reason = why_not(model) or f"it is not built: run ./gravcomp model build {source}"
        raise ConfigError(f"{source}: there is no reduced model for the board: {reason}")
    return reduction


def blob_for(parameters: LoopParameters) -> bytes:
    """Return the blob of a robot, kept by content in the cache.

    Raises ConfigError where it does not fit, or its reduced model is not built.
    """
    model = RobotModel(parameters.robot)
    reduction = reduction_for(model, parameters.source)
    of_reduction = reduction.basis, reduction.elasticity.linear, reduction.elasticity.quadratic
    own = dataclasses.replace(parameters, source="")
    path = cache_path("firmware", content_key(own, *of_reduction, VERSION, SLOT_BYTES, LONGEST_MS, list(_EXTRA)), ".model")
    if not path.exists():
        write_whole(path, fit(model, reduction, parameters).blob)
    return path.read_bytes()


def cost(model: ReducedModel, share: int = 0) -> tuple[int, float]:
    """Return the multiply-adds of a step and its estimated time in ms at 168 MHz.

    share: points of a law of rubber of which a step computes the stiffness.
    """
    r, k = model.elasticity.linear.shape
    m, s, pairs = len(model.cables.rest_length), len(model.cables.cable), r * (r + 1) // 2
    parts = {
        "elasticity": 4 * pairs * k,  # J = a + B q and K = J^T J + sum eps B
        "cables": 6 * s * r,
        "factor": r**3 // 6,
        "answers": r * r * -(-(m + 4) // 4) * 4,
        "tension": pairs * m,
        "law": _law_cost(r, len(model.deviation.weight)) + share * _share_cost(r),
    }
    cycles = sum(_CYCLES[name] * count for name, count in parts.items()) + _REST_CYCLES + m * _CYCLES_OF_A_CABLE
    return sum(parts.values()), 1e3 * cycles / CLOCK_HZ


def _law_cost(modes: int, points: int) -> int:
    """Return the multiply-adds of a step for the force of a law of rubber at these points."""
    return points * (18 * modes + _LAW_FORCE)


def _share_cost(modes: int) -> int:
    """Return the multiply-adds for the stiffness of a law of rubber at one point."""
    return 81 * modes + 9 * modes * (modes + 1) // 2 + _LAW_STIFFNESS


def _check(whole: ReducedModel, parameters: LoopParameters) -> None:
    """Raise ConfigError for a robot that the loop on the board does not model, whatever the basis."""
    parameters.refuse_too_large()
    source, points = parameters.source, len(whole.deviation.weight)
    if points > LAW_POINTS_MAX:
        raise ConfigError(
            f"{source}: the material's law needs {points} points of the body; the firmware has room for {LAW_POINTS_MAX}"
        )
    if len(whole.section_rest) - 1 > POINTS_MAX:
        raise ConfigError(
            f"{source}: has {len(whole.section_rest) - 1} points of the backbone; the firmware has room for {POINTS_MAX}"
        )
    if len(whole.cables.cable) > PIECES_MAX:
        raise ConfigError(f"{source}: its cables have {len(whole.cables.cable)} pieces; the firmware has room for {PIECES_MAX}")


def _candidates(whole: ReducedModel) -> Iterator[tuple[ReducedModel, int]]:
    """Yield the bases with most strains of every size that fits, with the points of a law whose stiffness a step can compute.

    Where there is such a law, those with fewer strains as well: they leave more time for it.
    """
    points = len(whole.deviation.weight)
    for modes in range(min(whole.size, MODES_MAX) // TILE * TILE, 0, -TILE):
        for extra in _EXTRA:
            smaller = whole.of_first(modes, extra)
            share = min(points, _affordable(smaller))
            if fits(smaller) and (share >= _LEAST_SHARE or not points):
                yield smaller, share
                if not points:
                    break


def _affordable(model: ReducedModel) -> int:
    """Return at how many points there is time for the stiffness of a law of rubber."""
    cycles = 1e-3 * (LONGEST_MS - cost(model)[1]) * CLOCK_HZ
    return max(0, int(cycles / (_CYCLES["law"] * _share_cost(model.size))))


def fits(model: ReducedModel) -> bool:
    """Return whether the board has room and time for a model."""
    strains = model.elasticity.linear.shape[1]
    return strains <= STRAINS_MAX and _bytes(model) <= SLOT_BYTES and cost(model)[1] <= LONGEST_MS


def _bytes(model: ReducedModel) -> int:
    r, k = model.elasticity.linear.shape
    cables, points = len(model.cables.rest_length), len(model.section_rest) - 1
    return blob_bytes(r, k + -k % TILE, cables, len(model.cables.cable), points, len(model.deviation.weight), BRANCHES_MAX)


def _branches(model: RobotModel) -> tuple[tuple[float, float], ...]:
    """Return the branches of the material, of a robot with one kind of them."""
    return model.mesh.materials[0].branches


def error_of_loop(blob: bytes, whole: ReducedModel, model: RobotModel, run: HostRun) -> float:
    """Return the worst distance in m of the tip in the loop on the board from that of the whole reduced model, inf: it is lost.

    The loop is the C code on this machine, with the run's gravity and its own commands, which the whole model gets as well.
    """
    loop, tracker = StandaloneLoop(blob), ReducedTracker(whole, model.length)
    count, branches = len(model.robot.cables), _branches(model)
    tracker.place(np.zeros(whole.size), np.zeros(count))
    memory, wound, worst = Memory.of(branches, np.zeros(whole.size), tracker.strain), np.zeros(count), 0.0
    for step, gravity in enumerate(run.gravity):
        creep = memory.stress(SAMPLE_PERIOD) if branches else None
        # The loop lets gravity and pulls rise by itself.
        pulled = min(1.0, (step + 1) / LOADING_STEPS) * wound
        state = tracker.track(gravity, CableInput(wound=pulled), iterations=10, creep=creep)
        loop.follow(SAMPLE_PERIOD, run.gravity[max(step, LOADING_STEPS - 1)])
        result = loop.read()
        if not (state.converged and result.converged):
            return np.inf
        if branches:
            memory = memory.after(state.q, tracker.strain, SAMPLE_PERIOD)
        worst = max(worst, float(np.linalg.norm(whole.tip(state.q) - result.tip)))
        wound = result.displacement
    return worst


def _error(smaller: ReducedModel, model: RobotModel, run: HostRun) -> float:
    """Return the worst distance in m of the tip from the run's with the same gravity and commands, infinite where it is lost."""
    tracker, count = ReducedTracker(smaller, model.length), len(model.robot.cables)
    tracker.place(np.zeros(smaller.size), np.zeros(count))
    branches = _branches(model)
    memory = Memory.of(branches, np.zeros(smaller.size), tracker.strain)
    worst = 0.0
    for gravity, wound, tip in zip(run.gravity, run.wound, run.tip):
        creep = memory.stress(SAMPLE_PERIOD) if branches else None
        state = tracker.track(gravity, CableInput(wound=wound), iterations=10, creep=creep)
        if not state.converged:
            return np.inf
        if branches:
            memory = memory.after(state.q, tracker.strain, SAMPLE_PERIOD)
        worst = max(worst, float(np.linalg.norm(smaller.tip(state.q) - tip)))
    return worst


def _too_big(whole: ReducedModel, parameters: LoopParameters) -> str:
    """Return why not even the smallest basis fits."""
    smallest = whole.of_first(TILE, 0)
    return (
        f"{parameters.source}: no basis fits: {TILE} modes take {_bytes(smallest) / 1024:.0f} of {SLOT_BYTES // 1024} KB"
        f" and {cost(smallest)[1]:.1f} of {LONGEST_MS:g} ms"
    )
