"""Forces and tangent of the rod and its tendons, compiled.

With the strain epsilon = theta / L of an element between the cross-sections A and B (see rod.py):

    sigma = K (epsilon - epsilon_0) + ...                            Cosserat law; the history of the material adds to it, and
                                                                     `law_curve` what the law adds to a linear one
    delta theta = J_r^-1(theta) eta_B - J_l^-1(theta) eta_A          eta: body-frame variations of the two cross-sections

A tendon at the offset d with the tension T pulls in the element with T (t, d x t), t the unit vector along v + w x d + d' (D. C.
Rucker, R. J. Webster, "Statics and dynamics of continuum robots with general tendon routing and external loading", IEEE T-RO 27,
2011). Between disks it pulls at two holes: `add_chords` of routing.py.

A tendon is a spring that only pulls: T_0 = k max(0, u + l - l_0) + preload, u the displacement pulled in at the base. Because of
friction only the share s_e T_0 arrives in element e. A tendon couples all elements that it passes; `newton_step` of
band_solver.py adds its spring to the tangent as an update of rank one.

The parts that run for every element and tendon are inlined: as calls they make a time step of the rod 9 % slower.
"""

import math

import numpy as np
from numba import njit

from gravcomp.virtual.routing import Routing, add_chords
from gravcomp.virtual.se3 import inverse_jacobians


@njit(cache=True, error_model="numpy")
def assemble(
    orientation: np.ndarray,
    length: np.ndarray,
    strain: np.ndarray,
    rest_strain: np.ndarray,
    linear: np.ndarray,
    constant: np.ndarray,
    filament: np.ndarray,
    curve: np.ndarray,
    slip_stiffness: np.ndarray,
    slip_moment: np.ndarray,
    slip_strain: np.ndarray,
    routing: Routing,
    direction: np.ndarray,
    chord: np.ndarray,
    path: np.ndarray,
    tension: np.ndarray,
    share: np.ndarray,
    force: np.ndarray,
    centre: np.ndarray,
    gradient: np.ndarray,
    pull: np.ndarray,
    band: np.ndarray,
) -> np.ndarray:
    """Return the residual (n + 1, 6), internal minus external forces, in body-frame variations of the cross-sections.

    Parameters
    ----------
    orientation : (n + 1, 3, 3)
        Of the cross-sections.
    length : (n,) m
        Of the elements at rest.
    strain, rest_strain : (n, 6)
        Of the elements; epsilon_0 is that of the unloaded rod.
    linear, constant : (n, 6, 6), (n, 6)
        Of the material's law: sigma = linear (epsilon - epsilon_0) + constant + curve + friction + tendons.
    filament, curve : (n, 9, 3), (n, 3)
        Of the law's curve, see law_curve.py.
    slip_stiffness, slip_moment, slip_strain : (n,) N m^2, (n,) N m, (n, 2) 1/m
        Of the material's friction, see material.py.
    routing : Routing
        Of the `RodModel`.
    direction, chord, path : (m, n, 3), (q, 4), (m, n) m
        From `tendon_lengths`.
    tension : (m,) N
        At the base.
    share : (m, n)
        Fraction of the tension that arrives in each element.
    force, centre : (n + 1, 3) N, (n + 1, 3) m
        On the cross-sections, in the fixed frame, and the point of the section where it acts.
    gradient : (6 n, m)
        Filled with d path / d eta.
    pull : (6 n, m)
        Filled with d residual / d tension.
    band : (6 n, 2 w + 1)
        Filled with the tangent without the tendons' springs; w is `half_bandwidth` of the routing's reach.

    The first cross-section is clamped and has no rows in gradient, pull and band.
    """
    n, m = length.shape[0], tension.shape[0]
    residual = np.zeros((n + 1, 6))
    gradient[:] = 0.0
    pull[:] = 0.0
    band[:] = 0.0
    left, right = np.empty((6, 6)), np.empty((6, 6))
    tangent, product = np.empty((6, 6)), np.empty((6, 6))
    theta, sigma, unit = np.empty(6), np.empty(6), np.empty(6)
    to_a, to_b = np.empty(6), np.empty(6)
    for e in range(n):
        for i in range(6):
            theta[i] = strain[e, i] * length[e]
        inverse_jacobians(theta, left, right)
        _material(
            strain[e], rest_strain[e], linear[e], constant[e], slip_stiffness[e], slip_moment[e], slip_strain[e], sigma, tangent
        )
        _add_curve(strain[e], rest_strain[e], filament[e], curve[e], sigma, tangent)
        for c in range(m):
            if not routing.inside[c, e]:
                continue
            here = tension[c] * share[c, e]
            _add_tendon(here, here * length[e] / path[c, e], routing.offset[c, e], direction[c, e], unit, sigma, tangent)
            _to_sections(left, right, unit, to_a, to_b)
            for i in range(6):
                if e > 0:
                    gradient[6 * (e - 1) + i, c] += to_a[i]
                    pull[6 * (e - 1) + i, c] += share[c, e] * to_a[i]
                gradient[6 * e + i, c] += to_b[i]
                pull[6 * e + i, c] += share[c, e] * to_b[i]
        _to_sections(left, right, sigma, to_a, to_b)
        for i in range(6):
            residual[e, i] += to_a[i]
            residual[e + 1, i] += to_b[i]
            for j in range(6):
                tangent[i, j] /= length[e]
        _add_to_band(e, left, right, sigma, tangent, product, band)
    add_chords(orientation, routing, chord, tension, share, residual, gradient, pull, band)
    _add_load(orientation, force, centre, residual, band)
    return residual


def half_bandwidth(reach: int) -> int:
    """Return the diagonals on either side of the tangent of cross-sections that couple over `reach` elements."""
    return 6 * reach + 5


@njit(cache=True, error_model="numpy", inline="always")
def _material(
    strain: np.ndarray,
    rest_strain: np.ndarray,
    linear: np.ndarray,
    constant: np.ndarray,
    slip_stiffness: float,
    slip_moment: float,
    slip_strain: np.ndarray,
    sigma: np.ndarray,
    tangent: np.ndarray,
) -> None:
    """Write stress (6,) and tangent (6, 6) d sigma / d epsilon of the material of one element."""
    for i in range(6):
        sigma[i] = constant[i]
        for j in range(6):
            sigma[i] += linear[i, j] * (strain[j] - rest_strain[j])
            tangent[i, j] = linear[i, j]
    k0 = slip_stiffness * (strain[3] - slip_strain[0])
    k1 = slip_stiffness * (strain[4] - slip_strain[1])
    trial = math.sqrt(k0 * k0 + k1 * k1)
    factor = 1.0 if trial <= slip_moment else slip_moment / trial
    sigma[3] += factor * k0
    sigma[4] += factor * k1
    tangent[3, 3] += factor * slip_stiffness
    tangent[4, 4] += factor * slip_stiffness


@njit(cache=True, error_model="numpy", inline="always")
def _add_curve(
    strain: np.ndarray, rest_strain: np.ndarray, filament: np.ndarray, curve: np.ndarray, sigma: np.ndarray, tangent: np.ndarray
) -> None:
    """Add stress (6,) and tangent (6, 6) of E (c e^2 + d e^3) in the filaments of a section, see law_curve.py."""
    stretch, x, y = strain[2] - rest_strain[2], strain[3] - rest_strain[3], strain[4] - rest_strain[4]
    for f in range(filament.shape[0]):
        b, a = filament[f], filament[f, 2]
        own = stretch + x * b[0] + y * b[1]
        bent = max(own, curve[2])
        rise = a * bent * (2.0 * curve[0] + 3.0 * curve[1] * bent)
        force = a * bent * bent * (curve[0] + curve[1] * bent) + rise * (own - bent)
        sigma[2] += force
        sigma[3] += force * b[0]
        sigma[4] += force * b[1]
        tangent[2, 2] += rise
        tangent[2, 3] += rise * b[0]
        tangent[2, 4] += rise * b[1]
        tangent[3, 3] += rise * b[0] * b[0]
        tangent[3, 4] += rise * b[0] * b[1]
        tangent[4, 4] += rise * b[1] * b[1]
    tangent[3, 2], tangent[4, 2], tangent[4, 3] = tangent[2, 3], tangent[2, 4], tangent[3, 4]


@njit(cache=True, error_model="numpy", inline="always")
def _add_tendon(
    tension: float,
    scale: float,
    offset: np.ndarray,
    direction: np.ndarray,
    unit: np.ndarray,
    sigma: np.ndarray,
    tangent: np.ndarray,
) -> None:
    """Add stress and tangent of one tendon in one element; write (t, d x t) to unit (6,).

    tension: N, in the element; scale: tension / |v + w x d|; offset (3,) m is d, direction (3,) is t.
    """
    d0, d1 = offset[0], offset[1]
    t0, t1, t2 = direction[0], direction[1], direction[2]
    unit[0], unit[1], unit[2] = t0, t1, t2
    unit[3], unit[4], unit[5] = d1 * t2, -d0 * t2, d0 * t1 - d1 * t0
    for i in range(6):
        sigma[i] += tension * unit[i]
    # d(t)/d(epsilon) = (1 - t t^T) [1, -d^] / |v + w x d|
    for j in range(6):
        b0, b1, b2 = -t0 * unit[j], -t1 * unit[j], -t2 * unit[j]
        if j == 0:
            b0 += 1.0
        elif j == 1:
            b1 += 1.0
        elif j == 2:
            b2 += 1.0
        elif j == 3:
            b2 += d1
        elif j == 4:
            b2 -= d0
        else:
            b0 -= d1
            b1 += d0
        a0, a1, a2 = scale * b0, scale * b1, scale * b2
        tangent[0, j] += a0
        tangent[1, j] += a1
        tangent[2, j] += a2
        tangent[3, j] += d1 * a2
        tangent[4, j] -= d0 * a2
        tangent[5, j] += d0 * a1 - d1 * a0


@njit(cache=True, error_model="numpy", inline="always")
def _to_sections(left: np.ndarray, right: np.ndarray, stress: np.ndarray, to_a: np.ndarray, to_b: np.ndarray) -> None:
    """Write the forces (6,) of an element's stress (6,) on the cross-sections A and B to to_a and to_b."""
    for i in range(6):
        a, b = 0.0, 0.0
        for j in range(6):
            a -= left[j, i] * stress[j]
            b += right[j, i] * stress[j]
        to_a[i], to_b[i] = a, b


@njit(cache=True, error_model="numpy")
def _add_to_band(
    e: int,
    left: np.ndarray,
    right: np.ndarray,
    sigma: np.ndarray,
    tangent: np.ndarray,
    product: np.ndarray,
    band: np.ndarray,
) -> None:
    """Add the tangent of element e, tangent (6, 6) being d sigma / d theta; product (6, 6) is scratch."""
    middle = band.shape[1] // 2
    for side in range(2):  # columns: variation of A, then of B
        jacobian = left if side == 0 else right
        sign = -1.0 if side == 0 else 1.0
        column = 6 * (e - 1 + side)
        if column < 0:
            continue
        for i in range(6):
            for j in range(6):
                value = 0.0
                for k in range(6):
                    value += tangent[i, k] * jacobian[k, j]
                product[i, j] = sign * value
        for i in range(6):
            for j in range(6):
                # The stress turns with the strain: half of ad(d theta)^T sigma on either side.
                if i < 3:
                    p, q = (i + 1) % 3, (i + 2) % 3
                    turning = sign * (sigma[p] * jacobian[3 + q, j] - sigma[q] * jacobian[3 + p, j])
                else:
                    p, q = (i - 2) % 3, (i - 1) % 3
                    turning = sign * (sigma[p] * jacobian[q, j] - sigma[q] * jacobian[p, j])
                    turning += sign * (sigma[3 + p] * jacobian[3 + q, j] - sigma[3 + q] * jacobian[3 + p, j])
                to_a, to_b = 0.5 * turning, 0.5 * turning
                for k in range(6):
                    to_a -= left[k, i] * product[k, j]
                    to_b += right[k, i] * product[k, j]
                if e > 0:
                    row = 6 * (e - 1) + i
                    band[row, column + j - row + middle] += to_a
                row = 6 * e + i
                band[row, column + j - row + middle] += to_b


@njit(cache=True, error_model="numpy")
def _add_load(orientation: np.ndarray, force: np.ndarray, centre: np.ndarray, residual: np.ndarray, band: np.ndarray) -> None:
    """Subtract the forces on the cross-sections from the residual, and add how they change with the rotations to the band."""
    middle = band.shape[1] // 2
    for k in range(orientation.shape[0]):
        r = orientation[k]
        c0, c1, c2 = centre[k, 0], centre[k, 1], centre[k, 2]
        f0 = r[0, 0] * force[k, 0] + r[1, 0] * force[k, 1] + r[2, 0] * force[k, 2]
        f1 = r[0, 1] * force[k, 0] + r[1, 1] * force[k, 1] + r[2, 1] * force[k, 2]
        f2 = r[0, 2] * force[k, 0] + r[1, 2] * force[k, 1] + r[2, 2] * force[k, 2]
        residual[k, 0] -= f0
        residual[k, 1] -= f1
        residual[k, 2] -= f2
        residual[k, 3] -= c1 * f2 - c2 * f1
        residual[k, 4] -= c2 * f0 - c0 * f2
        residual[k, 5] -= c0 * f1 - c1 * f0
        if k > 0:
            row = 6 * (k - 1)
            band[row, middle + 4] += f2
            band[row, middle + 5] -= f1
            band[row + 1, middle + 2] -= f2
            band[row + 1, middle + 4] += f0
            band[row + 2, middle + 1] += f1
            band[row + 2, middle + 2] -= f0
            # Rows of the moment c x f: the columns are those of the rotation.
            band[row + 3, middle] += c1 * f1 + c2 * f2
            band[row + 3, middle + 1] -= c1 * f0
            band[row + 3, middle + 2] -= c2 * f0
            band[row + 4, middle - 1] -= c0 * f1
            band[row + 4, middle] += c0 * f0 + c2 * f2
            band[row + 4, middle + 1] -= c2 * f1
            band[row + 5, middle - 2] -= c0 * f2
            band[row + 5, middle - 1] -= c1 * f2
            band[row + 5, middle] += c0 * f0 + c1 * f1
