"""Laws of rubber on the board: their stress and tangent in float32 against those of the host."""

import ctypes
import re

import numpy as np
import pytest

from gravcomp.firmware import model_blob
from gravcomp.firmware.host_library import load
from gravcomp.firmware.model_blob import SETTINGS, law_constants
from gravcomp.firmware.model_settings import BRANCHES_MAX, CABLES_MAX
from gravcomp.firmware.sources import STANDALONE, firmware_folder
from gravcomp.materials.laws import LAWS
from gravcomp.reduction.law_deviation import LawDeviation, add_deviation_stiffness, deviating_stress, deviation_at
from gravcomp.training import BuildOptions

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


class Model(ctypes.Structure):
    """`gc_model` of standalone/model.h."""

    _fields_ = (
        *((name, ctypes.c_uint32) for name in ("modes", "strains", "cables", "pieces", "points", "law_points", "branches")),
        ("before", ctypes.c_void_p * 15),
        ("law_change", ctypes.c_void_p),
        ("law", ctypes.c_void_p),
        ("branch", ctypes.c_void_p),
        ("settings", ctypes.c_void_p),
        ("behind", ctypes.c_void_p * 3),
    )


def test_the_stiffness_of_a_law_is_that_of_the_shape_once_each_point_has_had_its_turn():
    """Whatever shapes were there before: what is renewed takes the place of the old."""
    modes, count, rng = 4, 5, np.random.default_rng(1)
    gradient = rng.normal(size=(modes, 9, count)).astype(np.float32)
    law = np.full(count, LAWS["neo_hookean"].code)
    of = LawDeviation(gradient.reshape(modes, -1), np.full(count, 2e-9), law, np.tile((FIRST, SHEAR, 0.0, 0.0), (count, 1)))
    change = np.ascontiguousarray(gradient.transpose(2, 0, 1))
    constants, settings = law_constants(of).astype(np.float32), np.zeros(SETTINGS, np.float32)
    settings[-10] = 2.0  # points in a call
    tables = {"law_change": change.ctypes.data, "law": constants.ctypes.data, "settings": settings.ctypes.data}
    model, state = Model(modes=modes, law_points=count, **tables), (ctypes.c_uint64 * 8000)()
    q = np.zeros(modes, np.float32)
    for k in range(403):
        if k < 401:
            q = rng.normal(0.0, 0.03, modes).astype(np.float32)
        force, matrix = np.zeros(modes, np.float32), np.zeros(10, np.float32)
        load().gc_law_deviation_at(ctypes.byref(model), ctypes.c_void_p(q.ctypes.data), state, ctypes.c_void_p(force.ctypes.data))
    add = load().gc_law_deviation_add_stiffness
    add.restype, add.argtypes = None, (*[ctypes.c_void_p] * 3, ctypes.c_float)
    add(ctypes.addressof(model), ctypes.addressof(state), matrix.ctypes.data, 1.0)
    point, wanted = deviation_at(of, q.astype(float)), np.zeros((modes, modes))
    add_deviation_stiffness(of, point, wanted)
    np.testing.assert_allclose(force, point.force, atol=1e-4 * np.abs(point.force).max())
    np.testing.assert_allclose(matrix, wanted[np.tril_indices(modes)], atol=1e-4 * np.abs(wanted).max())


def test_blob_and_build_count_on_the_room_that_the_firmware_has():
    header = (firmware_folder() / STANDALONE / "model.h").read_text(encoding="utf-8")
    room = {name: int(number) for name, number in re.findall(r"#define GC_(\w+_MAX) (\d+)u", header)}
    assert BuildOptions().board_points == room["LAW_POINTS_MAX"]
    for name in ("MODES_MAX", "STRAINS_MAX", "PIECES_MAX", "POINTS_MAX", "LAW_POINTS_MAX"):
        assert getattr(model_blob, name) == room[name], name
    assert (room["CABLES_MAX"], room["BRANCHES_MAX"]) == (CABLES_MAX, BRANCHES_MAX)
