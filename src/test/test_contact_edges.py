"""Contact with obstacles that have sharp edges: the point of an outline next to them, and robots that lie on them."""

import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gravcomp.bench.contact_scenes import scene_of
from gravcomp.bench.sampled_depth import sampled_depth
from gravcomp.contact.outline_gap import deepest
from gravcomp.contact.places import find_places
from gravcomp.contact.start import refuse_start
from gravcomp.contact.surface import contact_surface
from gravcomp.description import Elements, load_robot_file
from gravcomp.full_model.contact import FullContact
from gravcomp.simulation import RobotModel, Simulator

HALF = 7.0  # mm, of a cube


@pytest.fixture(scope="module")
def model():
    return RobotModel(dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=5)))


def cube(kind, folder, centre_mm=(0.0, 0.0, 0.0), rpy_deg=(0.0, 0.0, 0.0), friction=0.0):
    """Return a scene with a cube: a box, or a surface from a file."""
    common = {"friction": friction}
    if kind == "box":
        return scene_of(boxes=[common | {"centre_mm": list(centre_mm), "size_mm": 3 * [2 * HALF], "rpy_deg": list(rpy_deg)}])
    body = trimesh.creation.box(3 * [2 * HALF])
    body.apply_transform(trimesh.transformations.euler_matrix(*np.deg2rad(rpy_deg)))
    body.apply_translation(centre_mm)
    body.export(folder / "cube.stl")
    return scene_of(meshes=[common | {"file": str(folder / "cube.stl"), "file_unit_mm": 1}])


@pytest.mark.parametrize("kind", ["box", "surface"])
@pytest.mark.parametrize("station", [20, 39], ids=["middle", "tip"])
def test_no_outline_is_in_an_edge_unseen(model, tmp_path, kind, station):
    """Sections near faces, edges and corners, in all directions: the gap is never larger than that of sampled outlines.

    Where the nearest place is across the robot, the gap and the direction of the force are known.
    """
    scene, surface, rng = cube(kind, tmp_path), contact_surface(model.robot), np.random.default_rng(1)
    radius, angle = surface.radius[station], np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    around = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    own, normal = np.zeros(2), np.zeros(3)
    for case in range(300):
        place, sharp = rng.uniform(-0.9, 0.9, 3), rng.permutation(3)[: 1 + case % 3]  # on a face, an edge or a corner
        place[sharp] = np.sign(place[sharp])
        away = np.zeros(3)
        away[sharp] = place[sharp] * rng.uniform(0.1, 1.0, len(sharp))
        away /= np.linalg.norm(away)
        axis = np.cross(away, rng.standard_normal(3))
        across = case % 2 == 0
        axis = axis / np.linalg.norm(axis) + (0.0 if across else rng.uniform(-0.3, 0.3)) * away
        axis /= np.linalg.norm(axis)
        one = np.cross(axis, rng.standard_normal(3))
        one /= np.linalg.norm(one)
        off = rng.uniform(-1e-5, 3e-4)
        middle = 1e-3 * HALF * place + (radius + off) * away
        section = np.array([middle, one, np.cross(axis, one)])
        gap = deepest(scene.arrays, 0, surface, station, section, own, normal)
        sampled = scene.nearest(section[0] + around @ section[1:])[0].min()
        assert gap < sampled + 1e-9
        if across:
            assert gap == pytest.approx(off, abs=1e-10)
            assert normal == pytest.approx(away, abs=1e-6)


@pytest.mark.parametrize("kind", ["box", "surface"])
def test_a_robot_touches_neither_its_mount_nor_a_wall_ahead(model, tmp_path, kind):
    """A straight robot between two cubes: its base is on one, and its tip is 0.125 mm from the other."""
    surface, own, normal = contact_surface(model.robot), np.zeros(2), np.zeros(3)
    for centre, gap in ((-HALF, 0.0), (1e3 * model.length + 0.125 + HALF, 1.25e-4)):
        scene = cube(kind, tmp_path, (0.0, 0.0, centre))
        refuse_start(scene, model.robot)
        sections = [np.array([[0.0, 0.0, place], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) for place in surface.place]
        found = [deepest(scene.arrays, 0, surface, s, section, own, normal) for s, section in enumerate(sections)]
        assert min(found) > gap - 1e-9


@pytest.mark.parametrize("kind", ["box", "surface"])
@pytest.mark.parametrize("where", ["along the robot", "across the robot", "a corner"])
def test_a_robot_on_an_edge_enters_nothing_and_gains_no_energy(model, tmp_path, kind, where):
    """Gravity turns there and back; points all over the surface are in no obstacle, and contact gives the robot nothing.

    Without friction the robot would slide off, and what it loses then is not of contact.
    """
    length, radius = 1e3 * model.length, 0.5e3 * model.robot.segments[0].outer_diameter
    top = -radius - 6.0 - HALF
    place = {
        "along the robot": ((top, -0.1 - HALF, length - 1.0), (0.0, 0.0, 0.0), 0.8),
        "across the robot": ((top, 0.0, 0.7 * length - HALF),),
        "a corner": ((-radius - 4.0 - 3**0.5 * HALF, 0.0, 0.7 * length), (45.0, np.degrees(np.arctan(2**0.5)), 0.0), 0.8),
    }
    simulator = Simulator(model, reduced=False, scene=cube(kind, tmp_path, *place[where]))
    angles = np.deg2rad([0.0, 4.0, 8.0, 4.0, 0.0])
    down = [Rotation.from_rotvec([0.3 * a, 0.3 * a, a]).apply([-9.81, 0.0, 0.0]) for a in angles]
    assert simulator.solve(down[0]).is_equilibrium
    moved, net, work = simulator.displacements.copy(), 0.0, 0.0
    first, last = model.elements.energy(moved), down[0]
    for gravity in down:
        shape = simulator.step(gravity)
        assert shape.is_equilibrium and len(shape.contacts)
        assert sampled_depth(simulator.solver.contact, simulator.displacements) < 2e-5
        part = float(model.nodal_weight @ (simulator.displacements - moved) @ (0.5 * (last + gravity)))
        moved, last, net, work = simulator.displacements.copy(), gravity, net + part, work + abs(part)
    gained = model.elements.energy(moved) - first - net
    assert gained < 1e-3 * work
    assert where != "across the robot" or gained > -1e-3 * work


def test_a_place_on_a_flat_face_has_no_curvature_where_the_middle_is_between_two_faces(model, tmp_path):
    """Every other face of a hexagonal lumen is of one row. From the middle of a section two of them are equally near."""
    radius = 0.5e3 * model.robot.segments[0].outer_diameter
    lumen = trimesh.creation.cylinder((radius + 0.05) / np.cos(np.pi / 6), 1e3 * model.length, sections=6)
    lumen.apply_translation([0.0, 0.0, 0.5e3 * model.length])
    lumen.export(tmp_path / "lumen.stl")
    contact = FullContact(model, scene_of(meshes=[{"file": str(tmp_path / "lumen.stl"), "side": "inside"}]))
    sections = contact.sections(np.zeros_like(model.mesh.nodes))
    toward = np.deg2rad(90.0) + 1e-4  # a face; those on both sides of it are of one row
    sections[:, 0] += 0.02e-3 * np.array([np.cos(toward), np.sin(toward), 0.0])
    last = np.zeros((len(contact.arrays.kind), contact.surface.slots, 3))
    places = find_places(contact.arrays, contact.surface, sections, np.zeros_like(sections[:, 0]), contact.margin, last)
    inner = (places.station > 5) & (places.station < len(sections) - 5)
    assert inner.any()
    np.testing.assert_allclose(places.curvature[inner], 0.0, atol=1e-3)


@pytest.mark.parametrize("turn", [0.0, 6.0, 15.0], ids=["in an edge", "next to it", "on a face"])
def test_a_robot_lies_in_a_lumen_of_flat_faces(model, tmp_path, turn):
    """A lumen from a file has faces that meet in hollow edges: a section in one touches both of its faces."""
    length, radius = 1e3 * model.length, 0.5e3 * model.robot.segments[0].outer_diameter
    lumen = trimesh.creation.cylinder(radius + 6.0, 2.0 * length, sections=12)
    lumen.apply_translation([0.0, 0.0, 0.5 * length])
    lumen.export(tmp_path / "lumen.stl")
    scene = scene_of(meshes=[{"file": str(tmp_path / "lumen.stl"), "side": "inside"}])
    simulator = Simulator(model, reduced=False, scene=scene)
    for angle in np.deg2rad([turn, turn + 4.0]):
        down = np.array([np.cos(angle), np.sin(angle), 0.0])
        shape = simulator.solve(9.81 * down) if angle == np.deg2rad(turn) else simulator.step(9.81 * down)
        assert shape.is_equilibrium, shape.message
        assert sampled_depth(simulator.solver.contact, simulator.displacements) < 2e-5
    normals = shape.contacts.normal
    held = shape.contacts.force.sum(axis=0) @ down
    assert held < -0.2 * 9.81 * model.mass
    assert turn != 0.0 or np.ptp(np.arctan2(normals[:, 1], normals[:, 0]) % (2 * np.pi)) > np.deg2rad(20.0)
