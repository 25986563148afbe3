"""Layers of elements along a body: thin at the clamp of a slender one, dense where it is soft, and how many are chosen."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest

from gravcomp.description import Cable, Lumen, Material, Robot, Section, Segment
from gravcomp.full_model import mesh_choice
from gravcomp.full_model.mesh_choice import chosen_mesh
from gravcomp.full_model.mesh_loads import MeshLoad
from gravcomp.mesh import tube_mesh
from gravcomp.mesh.layers import layers_of
from gravcomp.mesh.quality import mesh_quality


def test_a_mesh_at_the_largest_size_has_an_estimated_error(monkeypatch, tmp_path):
    """A catheter of a stiff shaft and a soft tip; with few unknowns allowed, its estimate must say that they are too few."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    monkeypatch.setattr(mesh_choice, "_MOST_UNKNOWNS", 1300)
    stiff, soft = (Material(youngs_modulus=e, poissons_ratio=0.3, density=1000.0) for e in (100e6, 4e6))
    segments = (Segment("shaft", 0.08, 2e-3, 1e-3, material=stiff), Segment("tip", 0.03, 2e-3, 1e-3, material=soft))
    robot = Robot("catheter", segments=segments, cables=(Cable("c", 0.0, 0.8e-3, segment="tip"),))
    choice = chosen_mesh(robot)
    assert choice.elements.softness > 0.0 and choice.elements.first_layer < 0.3e-3
    assert choice.error > mesh_choice.ACCURACY


FOUR_AROUND = Segment("a", 0.08, section=Section("ellipse", 18e-3, 12e-3), material=Material(youngs_modulus=0.5e6))
TUBE = Segment("a", 0.08, 10e-3, 4e-3, material=Material(youngs_modulus=0.5e6, poissons_ratio=0.45))


class MadeUp(mesh_choice._Tips):
    """Tips that are made up: `size` is the change from one mesh to another. Nothing is meshed, and no work is counted."""

    work = 0.0

    def __init__(self, robot, start):
        self._robot = robot
        self._loads = [MeshLoad("horizontal", np.zeros(3), np.zeros(0)), MeshLoad("bent", np.zeros(3), np.zeros(0))]

    def unknowns(self, elements):
        return 12 * elements.around * elements.along * elements.radial

    def cost(self, elements):
        return self.unknowns(elements)

    def work_of(self, elements):
        return 0.0

    def finer(self, elements, direction):
        finer = mesh_choice._finer(self._robot, elements, direction)
        return None if finer == elements else finer

    def change(self, one, other):
        return np.array([[self.size(one, other), 0.0, 0.0], np.zeros(3)])


def chosen_by(tips, segment, monkeypatch, folder):
    """The mesh that is chosen for a segment with made-up tips."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(folder))
    monkeypatch.setattr(mesh_choice, "_Tips", tips)
    monkeypatch.setattr(mesh_choice, "_MOST_UNKNOWNS", 6000)
    return chosen_mesh(Robot("finger", segments=(segment,)))


def test_a_load_without_equilibrium_is_named(monkeypatch, tmp_path, caplog):
    class Lost(MadeUp):
        def change(self, one, other):
            return np.array([[1e-5, 0.0, 0.0], np.full(3, np.nan)])

    material = Material(youngs_modulus=1e6, poissons_ratio=0.3, density=1000.0)
    chosen_by(Lost, Segment("s", 0.1, 10e-3, 4e-3, material=material), monkeypatch, tmp_path)
    assert "'finger' is chosen without the load 'bent'" in caplog.text and "horizontal" not in caplog.text


def test_the_choice_refines_around_before_cells_are_flat_and_ends_with_the_best_mesh_found(monkeypatch, tmp_path):
    """Cells through the wall always seem to gain most, and the estimate climbs with them."""

    class Climbing(MadeUp):
        asked: ClassVar[list] = []

        def size(self, one, other):
            self.asked.append(one)
            return 0.01 * (1 + one.radial) if other.radial > one.radial else 1e-4 * (other.around > one.around)

    choice = chosen_by(Climbing, FOUR_AROUND, monkeypatch, tmp_path)
    assert max(one.radial for one in Climbing.asked) >= 3
    assert all(one.radial <= 0.5 * one.around for one in Climbing.asked)
    assert choice.elements.radial == min(one.radial for one in Climbing.asked)


def by_power(change, one, other, order, direction):
    """The change from one number of elements to another, of an error that is `change` at four and falls with a power."""
    a, b = getattr(one, direction), getattr(other, direction)
    return change * ((4 / a) ** order - (4 / b) ** order)


def test_a_direction_with_a_small_part_of_the_error_is_not_refined_because_it_is_cheap(monkeypatch, tmp_path):
    """A layer more costs little, but each mesh on the way to enough elements around has to be measured."""

    class Around(MadeUp):
        asked: ClassVar[set] = set()

        def cost(self, elements):
            return self.unknowns(elements) ** 3 / elements.along**2

        def size(self, one, other):
            self.asked.add(one.along)
            return by_power(2.5e-3, one, other, 1.5, "around") + by_power(8e-4, one, other, 1.0, "along")

    choice = chosen_by(Around, FOUR_AROUND, monkeypatch, tmp_path)
    assert choice.error < mesh_choice.ACCURACY and Around.asked == {choice.elements.along}


def test_what_cannot_be_measured_any_more_of_the_last_mesh_follows_from_coarser_ones(monkeypatch, tmp_path):
    class Measured(MadeUp):
        asked: ClassVar[list] = []

        def work_of(self, elements):
            return 2.0 * mesh_choice._MOST_WORK * (elements.around > 8)

        def size(self, one, other):
            self.asked.append((one.around, other.around))
            return by_power(3.5e-3, one, other, 1.5, "around")

    choice = chosen_by(Measured, TUBE, monkeypatch, tmp_path)
    assert max(other for _, other in Measured.asked) == 8
    assert choice.elements.around == 8
    assert choice.error == pytest.approx(3.5e-3 * (1.0 - 0.5**1.5) * 0.5**1.5, rel=1e-6)


def test_flat_cells_do_not_tell_the_error_of_cells_that_are_not(monkeypatch, tmp_path):
    """A solid rod starts with few elements around, so the next ring would make its cells flat, whose tip is far off."""

    class FarWithFlatCells(MadeUp):
        def size(self, one, other):
            return 0.01 if other.radial > 0.5 * other.around else 1.5e-3 / one.radial**2 * (other.radial > one.radial)

    segment = Segment("a", 0.15, 10e-3, material=Material(youngs_modulus=0.5e6, poissons_ratio=0.49))
    choice = chosen_by(FarWithFlatCells, segment, monkeypatch, tmp_path)
    assert choice.error < mesh_choice.ACCURACY and choice.elements.radial == 2


def test_the_mesh_of_a_section_whose_division_does_not_change_with_each_number_is_chosen(monkeypatch, tmp_path):
    """Around two lumens in a rectangle 6 and 8 elements give the same division."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    monkeypatch.setattr(mesh_choice, "ACCURACY", 0.05)
    material = Material(youngs_modulus=26e6, poissons_ratio=0.4)
    section, lumens = Section("rectangle", 20e-3, 10e-3), (Lumen(4e-3, -5e-3), Lumen(4e-3, 5e-3))
    robot = Robot("flat", segments=(Segment("a", 0.1, material=material, section=section, lumens=lumens),))
    choice = chosen_mesh(robot)
    assert 0.0 < choice.error < 0.05


def test_the_first_mesh_of_a_tapered_body_with_lumens_is_well_shaped_with_its_thin_layers():
    lumens = tuple(Lumen(5e-3, 7e-3 * np.cos(a), 7e-3 * np.sin(a), True) for a in (0.0, 2.1, 4.2))
    arm = Segment("arm", 0.25, 30e-3, lumens=lumens, tip_outer_diameter=8e-3)
    robot = Robot("octopus", segments=(arm,))
    elements = mesh_choice._start(robot)
    assert elements.first_layer is not None
    assert mesh_quality(tube_mesh(dataclasses.replace(robot, elements=elements))).jacobian_ratio >= 0.2


def test_layers_double_from_the_clamp_and_are_denser_where_the_body_is_soft():
    materials = (Material(youngs_modulus=16e6), Material(youngs_modulus=1e6))
    robot = Robot("two", segments=tuple(Segment(f"s{i}", 0.1, 4e-3, material=m) for i, m in enumerate(materials)))
    heights, piece = layers_of(robot.pieces, 24, 1.0, first=0.5e-3)
    thickness = np.diff(heights)
    assert thickness[:3] == pytest.approx([0.5e-3, 1e-3, 2e-3], rel=0.2)
    assert thickness[10:] == pytest.approx(thickness[-1], rel=0.2) and heights[-1] == pytest.approx(0.2)
    assert pytest.approx(heights[piece.count(0)]) == 0.1
    heights, piece = layers_of(robot.pieces, 30, 1.0, softness=0.5)
    assert piece.count(1) == 4 * piece.count(0)
