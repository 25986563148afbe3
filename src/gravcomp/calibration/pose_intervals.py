"""Intervals of what is fitted to poses, and what the poses do not show.

cov = (J^T J / (s^2 d) + P)^-1, with the residuals' variance s^2, the prior P, and the design effect d. Residuals of one marker
are alike in all poses where it was not placed quite as described, and those of one pose are alike in all markers where friction
or creep holds the body; k alike residuals count as one. With the intraclass correlation rho of groups of k residuals, by the
analysis of variance, d = 1 + (k - 1) rho (L. Kish, Survey Sampling, 1965; B. R. Moulton, Journal of Econometrics 32, 1986).

What the residuals do not show is added to the half intervals: by how much x would differ if the clamp did not hold the section
(`systematic`). The finite elements hold all of the clamped face, which resists the contraction across that bending brings; a real
clamp or a rod does not, or not wholly. Without lateral contraction (Poisson's ratio zero) there is nothing to resist, and the
bending stiffness of a rod does not depend on it: that model's markers minus the model's are the largest error that the clamp
makes, with what elements near the clamp resist in addition.
"""

from collections.abc import Sequence

import numpy as np

LITTLE = 0.8
"""Of the prior's interval: an unknown whose interval is wider is hardly shown by the data."""

_OPEN = 1e-4  # precision of an unknown without a prior that nothing shows: a deviation of 100
_ALONE = 0.3  # half interval of a logarithm without a prior from which the data hardly show it
_TOGETHER = 0.95  # correlation of two unknowns that are known together only
_FAR = 8.0  # of the median distance, that is twelve standard deviations of noise
_FEWEST = 6  # markers in all poses, from which their median says what is usual


def design_effect(residual: np.ndarray) -> float:
    """Return d >= 1 of residuals (k, p, 3) of p markers in k poses: the larger of that by marker and that by pose."""
    by_marker = residual.reshape(len(residual), -1).T  # (3 p, k)
    by_pose = residual.transpose(0, 2, 1).reshape(-1, residual.shape[1])  # (3 k, p)
    return max(_effect(by_marker), _effect(by_pose))


def _effect(groups: np.ndarray) -> float:
    """Return d of groups (g, k) whose expected mean is zero."""
    number, size = groups.shape
    if size < 2:
        return 1.0
    means = groups.mean(axis=1)
    between = size * float((means**2).mean())
    within = float(((groups - means[:, None]) ** 2).sum()) / (number * (size - 1))
    total = between + (size - 1) * within
    correlation = (between - within) / total if total > 0.0 else 0.0
    return 1.0 + (size - 1) * max(correlation, 0.0)


def covariance(jacobian: np.ndarray, residual: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Return the covariance (n, n) of x.

    jacobian: of the residuals (k, p, 3) by x, as (3 k p, n); prior (n,): whether an entry of x has a prior of deviation 1.
    """
    freedom = max(1, residual.size - jacobian.shape[1])
    variance = max(float((residual**2).sum()) / freedom, 1e-12) * design_effect(residual)
    return np.asarray(np.linalg.inv(jacobian.T @ jacobian / variance + np.diag(np.where(prior, 1.0, _OPEN))))


def systematic(jacobian: np.ndarray, change: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Return by how much (n,) x changes with residuals that change by `change` (3 k p,); NaN: not known, and left out.

    jacobian (3 k p, n) of the residuals by x; prior (n,): whether an entry of x has a prior of deviation 1.
    """
    known = np.isfinite(change)
    rows = jacobian[known]
    weights = rows.T @ rows + np.diag(np.where(prior, 1.0, _OPEN))
    return np.abs(np.linalg.solve(weights, rows.T @ change[known]))


def not_shown(names: Sequence[str], matrix: np.ndarray, prior: np.ndarray) -> list[str]:
    """Return sentences on the unknowns that the data hardly show, or show together only; matrix (n, n): the covariance of x."""
    deviation = np.sqrt(np.diag(matrix))
    hidden = np.where(prior, deviation > LITTLE, 1.96 * deviation > _ALONE)
    found = []
    if hidden.any():
        which = ", ".join(name for name, yes in zip(names, hidden) if yes)
        found.append(f"The poses hardly show {which}: what is fitted there is mostly what was described.")
    for i, name in enumerate(names):
        for j in range(i + 1, len(names)):
            alike = matrix[i, j] / (deviation[i] * deviation[j])
            if abs(alike) > _TOGETHER and not (hidden[i] and hidden[j]):
                found.append(
                    f"The poses show {name} and {names[j]} together only (correlation {alike:+.2f}): other poses, or one of"
                    " them measured by itself, would separate them."
                )
    return found


def mistaken(residual: np.ndarray, poses: Sequence[str], markers: Sequence[str]) -> list[str]:
    """Return sentences on single markers that are much farther off than the others; residual (k, p, 3) in m."""
    distance = np.linalg.norm(residual, axis=2)
    if distance.size < _FEWEST:
        return []
    usual = float(np.median(distance))
    return [
        f"Marker {markers[j]} of pose {poses[i]} is {1e3 * distance[i, j]:.3g} mm off after the fit, most are"
        f" {1e3 * usual:.2g} mm: was it taken for another one? It counts like the others."
        for i, j in np.argwhere(distance > _FAR * usual)
    ]
