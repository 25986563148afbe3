"""The least-squares fit of modulus, cable offsets, cable compliance and winding ratio to resting tips, and what can be said of its result.

    min over x of  sum_k |tip_k(x) - measured_k|^2 / sigma^2 + sum_i (x_i - mean_i)^2 / prior_i^2

Offsets, compliances and the winding ratio have priors (0 +- a millimetre; 0 +- what 5 % of a cable's length a newton would be; 1 +- 2 %), so
cables that are never taut keep theirs. Intervals are from the Jacobian at the solution: cov = s^2 (J^T J)^-1 with the variance s^2 of the
residuals, at 95 %. The modulus alone cannot be told from the density: gravity times density over modulus is what bends the robot, so density
is taken as given.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.statics import StaticParameters, StaticPrediction, StaticPredictor
from gravcomp.description import Robot

TIP_NOISE = 0.2e-3  # m: of a measured tip, once averaged over a window; the scale of the residuals before their own is known
OFFSET_PRIOR = 1e-3  # m
COMPLIANCE_PRIOR = 0.5e-3  # m/N
WINDING_PRIOR = 0.02
MODULUS_RANGE = (0.02, 50.0)  # times the modulus at the start
SEEN = 0.7  # a posterior deviation above this part of the prior's says that the data tell nothing
CORRELATED = 0.95


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter in its edge unit. `interval`: half width at 95 %; `seen`: the data tell it, not the prior."""

    name: str
    unit: str
    initial: float
    value: float
    interval: float
    seen: bool


@dataclass(frozen=True)
class StaticFit:
    """The result. rms in m over the windows; evaluations: of all windows' tips, before and after being the first and last."""

    parameters: StaticParameters
    estimates: tuple[Estimate, ...]
    before: StaticPrediction
    after: StaticPrediction
    windows: StillWindows
    rms_before: float
    rms_after: float
    evaluations: int
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Unknown:
    """A scaled entry of x: value = mean + scale x; `cables` it stands for; prior 1 in x, none for the modulus."""

    kind: str  # modulus, offset, compliance, winding
    cables: tuple[int, ...]
    scale: float


def fit_statics(
    robot: Robot,
    windows: StillWindows,
    *,
    offsets: bool = True,
    compliance: bool = True,
    winding: bool = True,
    progress: Callable[[str], None] = lambda sentence: None,
) -> StaticFit:
    """Fit to the windows. Raises MeasurementError when they cannot tell the modulus."""
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    if not robot.segments:
        raise MeasurementError(f"robot '{robot.name}' has a body from a file; calibration needs segments")
    predictor = StaticPredictor(robot, windows)
    initial = StaticParameters(
        robot.segments[0].material.youngs_modulus,
        np.zeros(len(robot.cables)),
        predictor_compliance(robot),
    )
    before = predictor.predict(initial)
    bends = np.linalg.norm(before.by_modulus, axis=1).max() * initial.youngs_modulus
    if bends < 5 * TIP_NOISE:
        raise MeasurementError(
            f"twice the modulus would move the tips by {1e3 * bends:.2f} mm at most: gravity hardly bends the robot in these poses;"
            f" release it with its axis well away from the vertical"
        )
    unknowns = _unknowns(robot, before, offsets, compliance, winding)
    evaluations = [0]

    def values(x: np.ndarray) -> StaticParameters:
        modulus, offset, own, ratio = initial.youngs_modulus, initial.offset.copy(), initial.compliance.copy(), initial.winding
        for unknown, entry in zip(unknowns, x):
            cables = list(unknown.cables)
            if unknown.kind == "modulus":
                modulus = initial.youngs_modulus * np.exp(entry * unknown.scale)
            elif unknown.kind == "offset":
                offset[cables] = entry * unknown.scale
            elif unknown.kind == "winding":
                ratio += entry * unknown.scale
            else:
                own[cables] = initial.compliance[cables] + entry * unknown.scale
        return StaticParameters(modulus, offset, own, ratio)

    last: dict[bytes, StaticPrediction] = {}

    def predict(x: np.ndarray) -> StaticPrediction:
        key = x.tobytes()
        if key not in last:
            last.clear()
            evaluations[0] += 1
            last[key] = predictor.predict(values(x))
            error = np.linalg.norm(last[key].tip - windows.tip_position, axis=1)
            progress(f"evaluation {evaluations[0]}: {1e3 * np.sqrt(np.mean(error**2)):.3f} mm RMS")
        return last[key]

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([((predict(x).tip - windows.tip_position) / TIP_NOISE).ravel(), x[1:]])

    def jacobian(x: np.ndarray) -> np.ndarray:
        prediction, modulus = predict(x), values(x).youngs_modulus
        columns = []
        for unknown in unknowns:
            cables = list(unknown.cables)
            if unknown.kind == "modulus":
                column = prediction.by_modulus * modulus
            elif unknown.kind == "offset":
                column = prediction.by_offset[:, :, cables].sum(axis=2)
            elif unknown.kind == "winding":
                column = prediction.by_winding
            else:
                column = prediction.by_compliance[:, :, cables].sum(axis=2)
            columns.append((column * unknown.scale / TIP_NOISE).ravel())
        return np.concatenate([np.column_stack(columns), np.eye(len(x))[1:]])

    low = np.array([_lowest(u, initial) for u in unknowns])
    high = np.array([np.log(MODULUS_RANGE[1]) if u.kind == "modulus" else 20.0 for u in unknowns])
    # A start on a bound would hold the solver's first steps short.
    start = np.maximum(np.zeros(len(unknowns)), low + 0.2)
    solution = least_squares(residuals, start, jac=jacobian, bounds=(low, high), x_scale="jac", xtol=1e-4, ftol=1e-4, max_nfev=20)
    after, parameters = predict(solution.x), values(solution.x)

    misfit = (after.tip - windows.tip_position).ravel() / TIP_NOISE
    freedom = max(1, misfit.size - len(unknowns))
    variance = max(float(misfit @ misfit) / freedom, 1e-6)
    data_rows = jacobian(solution.x)[: misfit.size]
    precision = data_rows.T @ data_rows / variance + np.diag([0.0] + [1.0] * (len(unknowns) - 1))
    covariance = np.linalg.pinv(precision)
    deviation = np.sqrt(np.diag(covariance))
    quantile = float(student.ppf(0.975, freedom))
    estimates = tuple(
        _estimate(robot, unknown, initial, parameters, quantile * sigma, sigma) for unknown, sigma in zip(unknowns, deviation)
    )
    return StaticFit(
        parameters=parameters,
        estimates=estimates,
        before=before,
        after=after,
        windows=windows,
        rms_before=_rms(before.tip - windows.tip_position),
        rms_after=_rms(after.tip - windows.tip_position),
        evaluations=evaluations[0] + 1,
        warnings=tuple(_warnings(robot, windows, unknowns, estimates, covariance)),
    )


def predictor_compliance(robot: Robot) -> np.ndarray:
    """(m,) m/N: elongation of each cable's path in the robot under a newton, as the robot describes it."""
    return np.array([(robot.cable_end(c) - c.start) / c.axial_stiffness if c.axial_stiffness else 0.0 for c in robot.cables])


def _unknowns(robot: Robot, before: StaticPrediction, offsets: bool, compliance: bool, winding: bool) -> list[_Unknown]:
    """The modulus first; an offset for every cable that is taut somewhere; a compliance for all taut cables of a segment together; the
    winding ratio where any cable is taut.
    """
    taut = [c for c in range(len(robot.cables)) if (before.tension[:, c] > 1e-4).any()]
    unknowns = [_Unknown("modulus", (), 1.0)]
    if offsets:
        unknowns += [_Unknown("offset", (c,), OFFSET_PRIOR) for c in taut]
    if compliance:
        ends = sorted({robot.cable_end(robot.cables[c]) for c in taut})
        unknowns += [
            _Unknown(
                "compliance",
                tuple(c for c in range(len(robot.cables)) if robot.cable_end(robot.cables[c]) == end),
                COMPLIANCE_PRIOR,
            )
            for end in ends
        ]
    if winding and taut:
        unknowns.append(_Unknown("winding", tuple(taut), WINDING_PRIOR))
    return unknowns


def _lowest(unknown: _Unknown, initial: StaticParameters) -> float:
    if unknown.kind == "modulus":
        return float(np.log(MODULUS_RANGE[0]))
    if unknown.kind == "compliance":  # a cable cannot become shorter under tension
        return -float(initial.compliance[list(unknown.cables)].min()) / unknown.scale
    return -20.0


def _estimate(
    robot: Robot, unknown: _Unknown, initial: StaticParameters, final: StaticParameters, half: float, sigma: float
) -> Estimate:
    cables = list(unknown.cables)
    names = ", ".join(robot.cables[c].name for c in cables)
    if unknown.kind == "modulus":
        value = final.youngs_modulus * 1e-6
        return Estimate("Young's modulus", "MPa", initial.youngs_modulus * 1e-6, value, value * half, sigma < 0.25)
    if unknown.kind == "offset":
        return Estimate(f"offset of {names}", "mm", 0.0, 1e3 * final.offset[cables[0]], 1e3 * unknown.scale * half, sigma < SEEN)
    if unknown.kind == "winding":
        return Estimate("winding ratio", "", initial.winding, final.winding, unknown.scale * half, sigma < SEEN)
    first = cables[0]
    return Estimate(
        f"compliance of {names}", "mm/N", 1e3 * initial.compliance[first], 1e3 * final.compliance[first],
        1e3 * unknown.scale * half, sigma < SEEN,
    )  # fmt: skip


def _warnings(
    robot: Robot, windows: StillWindows, unknowns: list[_Unknown], estimates: tuple[Estimate, ...], covariance: np.ndarray
) -> list[str]:
    """What these data cannot tell."""
    found = []
    offset_of = {u.cables[0] for u in unknowns if u.kind == "offset"}
    slack = [c.name for i, c in enumerate(robot.cables) if i not in offset_of]
    if slack and any(u.kind == "offset" for u in unknowns):
        found.append(f"{', '.join(slack)}: never taut in these data, so the offset cannot be seen; it stays as it is")
    if not any(u.kind == "offset" for u in unknowns) and np.isfinite(windows.displacement).any():
        found.append("no cable is ever taut in these data: only the modulus was fitted")
    found += [
        f"{e.name}: these data hardly tell it (± {e.interval:.2g} {e.unit}); it stays near what was assumed"
        for e in estimates
        if not e.seen
    ]
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    for i in range(len(estimates)):
        for j in range(i):
            if abs(correlation[i, j]) > CORRELATED:
                found.append(
                    f"{estimates[j].name} and {estimates[i].name} can hardly be told apart (correlation {correlation[i, j]:+.2f}):"
                    " add poses in other directions"
                )
    return found


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt((error**2).sum(axis=1).mean()))
