"""The answer as sentences in mm, N and degrees."""

import numpy as np

from gravcomp.description import Robot
from gravcomp.holdability.answer import Binding, DirectionAnswer, Holdability
from gravcomp.holdability.directions import angles


def sentence(robot: Robot, answer: Holdability) -> str:
    """Return the answer and its worst direction in one sentence."""
    worst = answer.directions[answer.worst]
    if answer.held:
        start = (
            "the cables hold the tip in every direction of gravity" if len(answer.directions) > 1 else "the cables hold the tip"
        )
        return f"{start}; the largest load is {load(answer, worst)}, {toward(worst)}"
    if len(answer.directions) == 1:
        if not worst.known:
            return f"whether the cables hold the tip {toward(worst)} is not found: {reason(answer, worst)}"
        return f"the cables do not hold the tip {toward(worst)}: {reason(answer, worst)}"
    found = (
        f"the cables hold the tip in {100 * answer.held_share:.0f} % of the directions of gravity;"
        f" worst {toward(worst)}: {reason(answer, worst)}"
    )
    return found + (f"; not found in {len(answer.unknown)} directions" if answer.unknown and worst.known else "")


def reason(answer: Holdability, direction: DirectionAnswer) -> str:
    """Return what keeps the tip from being held in a direction; for one that is held, its load."""
    share = f"{100 * direction.share:.0f} % of gravity"
    match direction.binding:
        case Binding.NOTHING:
            return f"held with {load(answer, direction)}"
        case Binding.TENSION:
            most = f"the tension limit of {answer.tension_max:g} N binds in cable {direction.cable} at {share}"
            return most + (f"; {direction.tension:.3g} N are needed" if direction.tension is not None else "; no tension does")
        case Binding.DISPLACEMENT:
            most = f"the displacement limit of cable {direction.cable} binds at {share}"
            return most + (
                f"; {1e3 * direction.displacement:.3g} mm are needed" if direction.displacement is not None else "; none does"
            )
        case Binding.CABLES:
            return f"from {share} on no tension of the cables brings the tip nearer to the target"
        case Binding.BUCKLING:
            return f"the robot buckles at {share}"
        case Binding.EQUILIBRIUM:
            if direction.known:
                return f"no equilibrium that keeps the tip is found beyond {share}: {direction.cause}"
            return f"the search ended at {share}, which is no answer for more"
        case Binding.TARGET:
            return "the target is out of reach, even without gravity"


def load(answer: Holdability, direction: DirectionAnswer) -> str:
    """Return the load of the cables in a direction."""
    if direction.tension is None or direction.displacement is None:
        return "an unknown tension"
    travel = f"{1e3 * answer.displacement_min:g} to {1e3 * answer.displacement_max:g} mm"
    return f"{direction.tension:.3g} N of {answer.tension_max:g} N and {1e3 * direction.displacement:+.3g} mm of {travel}"


def toward(direction: DirectionAnswer) -> str:
    """Return where gravity points."""
    inclination, azimuth = np.degrees(angles(direction.direction))
    if inclination < 0.5:
        return "with gravity from base to tip"
    if inclination > 179.5:
        return "with gravity from tip to base"
    if abs(inclination - 90.0) < 0.5:
        return f"horizontal, with gravity toward {azimuth:.0f} deg"
    return f"with gravity {inclination:.0f} deg from the axis, toward {azimuth:.0f} deg"


def lines(robot: Robot, answer: Holdability) -> list[str]:
    """Return the whole answer as lines."""
    worst = answer.directions[answer.worst]
    short = "yes" if answer.held else "no" if answer.refuted else "not found"
    found = [f"can it be held: {short}; {sentence(robot, answer)}"]
    remaining = "not known within the limits" if worst.lateral is None else f"{1e3 * worst.lateral:.2f} mm with the cables pulled"
    released = "not known" if answer.released is None else f"{1e3 * answer.released:.1f} mm"
    found.append(
        f"  lateral error of the tip there: {released} released, {remaining}; it counts as held up to"
        f" {1e3 * answer.tolerance:.2g} mm"
    )
    found += [f"  {line}" for line in _needed(robot, answer)]
    if answer.buckling is not None and answer.buckling_direction is not None:
        where = toward(next(d for d in answer.directions if np.array_equal(d.direction, answer.buckling_direction)))
        what = "its equilibrium ends or buckles" if answer.ended else "it buckles"
        found.append(f"  {what} at {answer.buckling:.2f} times its weight, {where}")
    elif answer.overload > 1.0:
        found.append(f"  no buckling up to {answer.overload:g} times its weight")
    found.append(f"  computed with the {answer.model}, for {len(answer.directions)} directions of gravity")
    return found


def _needed(robot: Robot, answer: Holdability) -> list[str]:
    """Return what would hold the robot, as lines."""
    found, worst = answer.needed, answer.directions[answer.worst]
    if worst.held or worst.binding not in (Binding.TENSION, Binding.DISPLACEMENT):
        return []
    if found is None:
        return ["no tension up to the limit of the search holds it"]
    if worst.binding == Binding.DISPLACEMENT:
        assert found.displacement is not None and found.tension is not None
        return [f"it would be held with displacements of {1e3 * found.displacement:+.1f} mm and {found.tension:.3g} N"]
    assert found.tension is not None
    line = f"it would be held with a tension limit of {found.tension:.3g} N ({found.tension / answer.tension_max:.2g} times)"
    if found.radius_factor is None:
        return [line + "; no pitch radius was found with which the limit does"]
    radii = sorted({round(1e3 * cable.radius, 6) for cable in robot.cables if cable.radius is not None})
    wanted = ", ".join(f"{found.radius_factor * radius:.3g} mm instead of {radius:g}" for radius in radii)
    line += f", or with the cables {found.radius_factor:.2f} times as far from the axis" + (f" ({wanted})" if wanted else "")
    if found.radius_fits:
        return [line]
    line += ", which is outside the body"
    if found.widest_tension is not None and found.widest_factor is not None:
        line += f"; at the largest radius inside it ({found.widest_factor:.2f} times) {found.widest_tension:.3g} N are needed"
    return [line]
