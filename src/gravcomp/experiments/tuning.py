"""The article's tuning, a grid of 25 pairs of modulus and Rayleigh damping, against calibration.

e_total = (sum_k e_k) Var(e),    e_k = |p_sim(t_k) - p_real(t_k)|
"""

import dataclasses

import numpy as np

from gravcomp.calibration.course import course_options, predict_course
from gravcomp.calibration.measured import Measured
from gravcomp.calibration.motion import EVALUATIONS, fit_motion
from gravcomp.calibration.parameters import with_moduli
from gravcomp.description import Robot
from gravcomp.report.drawing import MODEL, REAL, WITHOUT, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.context import Context
from gravcomp.trials.free_fall import BRIEF_EVALUATIONS, BRIEF_FALL, FALL, free_fall
from gravcomp.trials.known_robot import Recovered, recover

TITLE = "Tuning: grid against calibration"

MODULI = (0.50, 0.65, 0.80, 1.00, 1.20)  # MPa, of the article's robot; that of another is varied by the same ratios
_MODULUS = 0.80  # MPa, described for the article's robot
RAYLEIGH = (0.10, 0.30, 0.50, 0.70, 1.00)  # C: alpha in 1/s and beta in s have the same value, as in the article
_PERIOD = 0.28  # s, first period of the article's robot; another robot's alpha and beta are as large for its own period
POSES = ((0.0, 0.0), (45.0, 0.0), (-45.0, 90.0))  # inclination, roll in deg


def run(context: Context) -> Result:
    """Run the experiment."""
    setup = context.setup
    poses = POSES[:1] if context.brief else POSES
    factor = 1e-6 * setup.robot.materials[0].youngs_modulus / _MODULUS
    of_article, dampings = (MODULI[1:3], RAYLEIGH[:2]) if context.brief else (MODULI, RAYLEIGH)
    moduli = tuple(factor * modulus for modulus in of_article)
    slower = setup.first_period / _PERIOD
    duration = (BRIEF_FALL if context.brief else FALL) * setup.first_period
    falls = context.map(free_fall, [(setup, *pose, duration, trial) for trial, pose in enumerate(poses)], "free falls for tuning")
    pairs = [(m, c) for m in moduli for c in dampings]
    errors = dict(zip(pairs, context.map(_pair, [(setup.robot, falls, m, c, slower) for m, c in pairs], "grid")))
    best = min(pairs, key=lambda pair: total(errors[pair]))
    # Only modulus and damping, as in the grid: two parameters against two.
    fit = fit_motion(
        setup.robot,
        falls,
        mapper=context.sweep.map,
        progress=lambda s: context.progress(f"calibration: {s}"),
        creep=False,
        evaluations=BRIEF_EVALUATIONS if context.brief else EVALUATIONS,
    )
    fitted = np.concatenate([np.linalg.norm(tip - f.tip_position, axis=1) for tip, f in zip(fit.predicted, falls)])
    recovered = recover(context)
    material = [r for r in recovered if "offset" not in r.name]
    offsets = [r for r in recovered if "offset" in r.name]
    ratio = total(errors[best]) / total(fitted)
    return Result(
        name="tuning",
        title=TITLE,
        question="With which modulus and damping does the model fall like the robot, and how many simulations are needed to"
        " find them?",
        ground="The dynamic model, in the core, against free falls of the virtual robot from straight. The robots with known"
        " parameters in the last table are virtual robots as well: a rod, not the finite elements of the model.",
        figures=[
            Figure("e_total ratio, best pair of the grid / calibration", ratio, "", "best pair of the grid", 1.0, True),
            Figure("RMS error, best pair of the grid", 1e3 * _rms(errors[best]), "mm"),
            Figure("RMS error, calibration", 1e3 * _rms(fitted), "mm", "", 1e3 * _rms(errors[best])),
            Figure(
                "evaluations, calibration", fit.evaluations, "", f"{len(MODULI) * len(RAYLEIGH)} pairs", float(len(pairs) - 1)
            ),
            Figure("known modulus and damping, largest error of the fit", 100 * max(r.error for r in material), "%", "", 2.0),
            Figure(
                "known cable offsets, largest error of the fit",
                max((abs(r.fitted - r.true) for r in offsets), default=np.nan),
                "mm",
            ),
        ],
        parts=[
            Plot(
                "The grid",
                _heat_map(moduli, dampings, errors, best, fit.youngs_modulus * 1e-6),
                "log10 of e_total (mm and mm²), a cubic spline through the 25 pairs (points). Circle: best pair. Line:"
                " calibrated modulus; the calibrated damping is not of the grid's kind.",
            ),
            Plot(
                "Fall in the first pose",
                _fall(setup.robot, falls[0], best, slower, fit.predicted[0]),
                "Lateral tip position. With the Rayleigh damping of the grid, whose stiffness part is 0.1 s and more, the"
                " robot is overdamped: it sinks slowly and does not swing as the virtual robot does.",
            ),
            Table(
                "e_total of the grid",
                ("modulus, MPa", *(f"C = {c:g}" for c in dampings)),
                [(f"{m:g}", *(total(errors[m, c]) for c in dampings)) for m in moduli],
                f"Best pair: {best[0]:g} MPa and C = {best[1]:g}, e_total {total(errors[best]):.3g}; calibration:"
                f" {total(fitted):.3g}.",
            ),
            _recovery_table(recovered),
        ],
        parameters={
            "calibrated modulus": f"{fit.youngs_modulus * 1e-6:.4f} ± {fit.modulus_interval * 1e-6:.4f} MPa",
            "calibrated damping time": f"{1e3 * fit.damping_time:.2f} ± {1e3 * fit.damping_interval:.2f} ms (Kelvin-Voigt)",
            "poses": poses,
            "duration_s": duration,
        },
        notes=[
            "An evaluation is a simulation of all poses with one pair; the calibration's include those for its derivatives.",
            "The finite elements are compliant around the end of a cable, the rod is not. The fitted offsets compensate this;"
            " their error exceeds their intervals by some hundredths of a millimetre.",
        ],
    )


def total(error: np.ndarray) -> float:
    """Return the article's e_total (mm and mm^2) of errors (t,) in m."""
    return float((1e3 * error).sum() * np.var(1e3 * error))


def _pair(job: tuple[Robot, list[Measured], float, float, float]) -> np.ndarray:
    """Return the errors (t,) in m of all falls with one pair of modulus and damping."""
    robot, falls, *pair = job
    return np.concatenate([np.linalg.norm(_rayleigh_fall(robot, fall, *pair) - fall.tip_position, axis=1) for fall in falls])


def _rayleigh_fall(robot: Robot, fall: Measured, modulus: float, damping: float, slower: float) -> np.ndarray:
    """Return the tip's course (t, 3) in m; modulus in MPa of the first segment, the others by the same ratio.

    damping: C of the article's robot; slower: first period over that robot's.
    """
    options = dataclasses.replace(
        course_options(robot), damping="rayleigh", rayleigh_mass=damping / slower, rayleigh_stiffness=damping * slower
    )
    moduli = np.array([material.youngs_modulus for material in robot.materials])
    return predict_course(with_moduli(robot, moduli * modulus * 1e6 / moduli[0]), fall, options)[0]


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt((error**2).mean()))


def _recovery_table(recovered: list[Recovered]) -> Table:
    rows = [
        (r.name, f"{r.true:.4g} {r.unit}", f"{r.fitted:.4g} ± {r.interval:.2g} {r.unit}", f"{100 * r.error:.2f} %" if "offset"
        not in r.name else
         f"{abs(r.fitted - r.true):.3f} mm")
        for r in recovered
    ]  # fmt: skip
    return Table(
        "Known parameters of virtual robots, and their fit",
        ("parameter", "known", "fitted, interval at 95 %", "error"),
        rows,
        "At rest: tips in up to three poses, released and with each cable pulled in twice, with a tracker's noise in every"
        " image. In motion: two free falls.",
    )


def _heat_map(moduli: tuple, dampings: tuple, errors: dict, best: tuple, calibrated: float) -> str:
    from scipy.interpolate import RectBivariateSpline

    grid = np.log10([[total(errors[m, c]) for c in dampings] for m in moduli])
    spline = RectBivariateSpline(moduli, dampings, grid, kx=min(3, len(moduli) - 1), ky=min(3, len(dampings) - 1))
    fine_m, fine_c = np.linspace(moduli[0], moduli[-1], 120), np.linspace(dampings[0], dampings[-1], 120)
    with Drawing(width=7.5, height=4.2) as drawing:
        axes = drawing.axes
        filled = axes.contourf(fine_m, fine_c, spline(fine_m, fine_c).T, levels=24, cmap="cividis_r")
        axes.plot(*np.array([(m, c) for m in moduli for c in dampings]).T, ".", color="#37404a", ms=4)
        axes.plot(*best, "o", ms=13, mfc="none", mec=REAL, mew=2.2, label="best pair")
        axes.axvline(calibrated, color=MODEL, linestyle="--", label="calibrated modulus")
        axes.set_xlabel("modulus in MPa")
        axes.set_ylabel("Rayleigh C")
        axes.legend(loc="upper left", labelcolor="#1c232b")
        drawing.figure.colorbar(filled, label="log10 e_total")
    return drawing.svg


def _fall(robot: Robot, fall: Measured, best: tuple[float, float], slower: float, calibrated: np.ndarray) -> str:
    with Drawing(width=9.0, height=3.2) as drawing:
        axes = drawing.axes
        axes.plot(fall.time, 1e3 * fall.tip_position[:, 0], color=REAL, label="virtual robot")
        axes.plot(fall.time, 1e3 * _rayleigh_fall(robot, fall, *best, slower)[:, 0], color=WITHOUT, label="best pair of the grid")
        axes.plot(fall.time, 1e3 * calibrated[:, 0], color=MODEL, label="calibration")
        axes.set_xlabel("time in s")
        axes.set_ylabel("lateral tip position in mm")
        axes.legend()
    return drawing.svg
