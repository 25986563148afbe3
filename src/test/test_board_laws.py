"""Laws of rubber on the board: their stress and tangent in float32 against those of the host."""

import ctypes

import numpy as np
import pytest

from gravcomp.firmware.host_library import load
from gravcomp.firmware.model_blob import law_constants
from gravcomp.materials.laws import LAWS
from gravcomp.reduction.law_deviation import LawDeviation, deviating_stress

FIRST, SHEAR = 3.0e6, 0.06e6  # Pa, nearly incompressible: Poisson's ratio is 0.49


@pytest.mark.parametrize(("name", "own"), [("neo_hookean", ()), ("mooney_rivlin", (0.25,)), ("yeoh", (0.18, 0.05))])
def test_the_stress_of_a_law_and_its_tangent_are_those_of_the_host(name, own):
    constants = np.array([FIRST, SHEAR, *own, *[0.0] * (2 - len(own))])
    law = LAWS[name].code
    rng = np.random.default_rng(0)
    points = LawDeviation(np.zeros((4, 9)), np.array([2.0e-9]), np.array([law]), constants[None])
    row = (ctypes.c_float * 6)(*law_constants(points)[0])
    board = load().gc_law_deviating_stress
    board.restype = None
    for _ in range(50):
        strain = rng.uniform(-0.12, 0.12, 6)
        stress, tangent = np.empty(6), np.empty((6, 6))
        deviating_stress(law, constants, strain, stress, tangent, True)
        found, slope = (ctypes.c_float * 6)(), (ctypes.c_float * 36)()
        board(row, (ctypes.c_float * 6)(*strain), found, slope)
        scale = 2.0e-9 * FIRST
        np.testing.assert_allclose(np.array(found) / scale, stress / FIRST, atol=2e-6)
        np.testing.assert_allclose(np.array(slope).reshape(6, 6) / scale, tangent / FIRST, atol=2e-5)
