"""The reduced model: exact polynomials, agreement with the full model, trained range, and fallback to the full model."""

import dataclasses
import pickle
import subprocess
import sys

import numpy as np
import pytest
from coarse_article import SMALL, built_once, cache_of_the_run, coarse
from scipy.spatial.transform import Rotation

from gravcomp.bench.contact_scenes import scene_of
from gravcomp.description import Cable, Elements, Fibres, Material, PronyTerm, Robot, Segment
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.statics import StaticSolver
from gravcomp.inverse import InverseController, straight_target
from gravcomp.mechanics.block_matrix import BlockMatrix
from gravcomp.mesh import MeshError, tube_mesh
from gravcomp.reduction import ReducedServing, load, path_of, why_not
from gravcomp.reduction.basis import energy_basis
from gravcomp.reduction.body import body_of, point_at
from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.cubature import Cubature, choose, sparse_weights
from gravcomp.reduction.law_deviation import add_deviation_stiffness, deviation_at
from gravcomp.reduction.reduced_cables import add_stiffness, tendons_at
from gravcomp.reduction.reduced_model import project, section_changes
from gravcomp.reduction.strain_polynomials import StrainPolynomials, strain_at, strain_polynomials, tangent
from gravcomp.simulation import DynamicSimulator, DynamicsOptions, RobotModel, ShapeStatus, Simulator
from gravcomp.training import BuildOptions, TrainingOptions, build
from gravcomp.training.build import trained
from gravcomp.training.compliance import compliances
from gravcomp.training.samples import Sample, _start, samples
from gravcomp.training.smallest import smallest
from gravcomp.training.trained_shapes import TrainedShapes


@pytest.fixture(scope="module")
def robot():
    return coarse()


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    with cache_of_the_run(tmp_path_factory):
        yield


@pytest.fixture(scope="module")
def built(robot, cache):
    """A model and its reduction."""
    return built_once(robot)


@pytest.fixture(scope="module")
def modes(robot):
    """A model, three smooth modes of it and shapes that they make."""
    model = RobotModel(robot)
    matrix = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), matrix)
    x, y, z = model.mesh.nodes[: model.n_free].T / model.length
    fields = [(z**2, 0 * z, -2 * x * z), (0 * z, z**3, -3 * y * z**2), (0 * z, 0 * z, z)]
    raw = np.array([np.stack(field, axis=1).ravel() for field in fields])
    basis = energy_basis(raw, matrix.multiply, 3)
    shapes = np.random.default_rng(0).normal(size=(30, 3)) @ (0.1 * basis.T)
    return model, matrix, basis, shapes


def force_and_stiffness(polynomials, q):
    """Internal force (r,) and tangent stiffness (r, r), lower triangle only, at q (r,)."""
    jacobian, strain = strain_at(polynomials.linear, polynomials.quadratic, q)
    return jacobian @ strain, tangent(jacobian, polynomials.quadratic, strain, 1.0)


def test_small_systems_are_solved_or_refused():
    root = np.random.default_rng(0).normal(size=(7, 7))
    matrix, columns = root @ root.T + np.eye(7), root[:, :3].copy()
    definite, factor = factorise(np.tril(matrix))  # the upper triangle is not read
    solved = columns.copy()
    solve(factor, solved)
    assert definite and matrix @ solved == pytest.approx(columns, abs=1e-12)
    matrix[3, 3] = -1.0
    assert not factorise(matrix)[0]
    matrix[3, 3] = np.nan
    assert not factorise(matrix)[0]


def test_basis_is_orthonormal_in_energy_and_holds_its_snapshots(modes):
    _, matrix, basis, shapes = modes
    assert basis.T @ matrix.multiply(basis) == pytest.approx(np.eye(3), abs=1e-10)
    again = energy_basis(shapes, matrix.multiply, 10)
    assert again.shape[1] == 3
    assert again @ (again.T @ matrix.multiply(shapes.T)) == pytest.approx(shapes.T, abs=1e-9)


def test_trained_shapes_are_multiplied_by_the_stiffness_once_for_all_that_is_asked(modes, monkeypatch):
    model, matrix, basis, shapes = modes
    none = np.zeros(model.tendons.count)
    samples, multiply = [Sample(shape, np.zeros(3), none, none, np.zeros(7)) for shape in shapes], BlockMatrix.multiply
    multiplied: list[int] = []
    monkeypatch.setattr(BlockMatrix, "multiply", lambda own, x: multiplied.append(x.shape[1]) or multiply(own, x))
    trained_shapes = TrainedShapes.of(samples, matrix)
    few = [energy_basis(trained_shapes.rows, matrix.multiply, 2, alike, trained_shapes.gram()) for alike in (False, True)]
    coordinates, missing = trained_shapes.coordinates(basis), trained_shapes.part(slice(0, 4)).missing(few[0])
    assert sorted(multiplied) == [2, 2, len(shapes)]  # a basis itself is once more, against rounding
    monkeypatch.undo()
    for of, alike in zip(few, (False, True)):
        assert of == pytest.approx(energy_basis(shapes, matrix.multiply, 2, alike), abs=1e-12 * np.abs(of).max())
    assert coordinates @ basis.T == pytest.approx(shapes, abs=1e-9)
    assert few[0].T @ matrix.multiply(missing.T) == pytest.approx(np.zeros((2, 4)), abs=1e-9) and np.abs(missing).max() > 1e-6


def test_large_snapshots_leave_modes_for_small_ones():
    """Fallen shapes of a soft robot are all much larger than those that it is held in, and need more modes than there are."""
    rng = np.random.default_rng(0)
    large, small = 100.0 * rng.normal(size=(8, 40)), rng.normal(size=(2, 40))
    snapshots = np.vstack([large, *[small + 0.01 * rng.normal(size=small.shape) for _ in range(10)]])
    few, most = (energy_basis(snapshots, lambda x: x, 4, alike=alike) for alike in (True, False))
    missed = [np.linalg.norm(small - small @ basis @ basis.T, axis=1).max() / np.linalg.norm(small) for basis in (few, most)]
    assert missed[0] < 0.1 and missed[1] > 0.5


def test_with_all_strains_forces_and_stiffness_are_those_of_the_elements(modes):
    # Three modes have nine different strains e_i and e_ij; the principal strains of thirty shapes hold all of them.
    model, _, basis, shapes = modes
    polynomials = strain_polynomials(model.elements, basis, shapes, extra=6)
    for q in 0.1 * np.random.default_rng(1).normal(size=(3, 3)):
        u = np.zeros_like(model.mesh.nodes)
        model.free(u)[:] = basis @ q
        matrix = model.new_matrix()  # that of the fixture belongs to all tests
        force = basis.T @ model.free(model.elements.assemble(u, matrix))
        own_force, own_stiffness = force_and_stiffness(polynomials, q)
        assert own_force == pytest.approx(force, rel=1e-6, abs=1e-9)
        assert np.tril(own_stiffness) == pytest.approx(np.tril(basis.T @ matrix.multiply(basis)), rel=1e-6, abs=1e-7)


def test_stiffness_is_the_derivative_of_the_force(modes):
    model, _, basis, shapes = modes
    polynomials = strain_polynomials(model.elements, basis, shapes, extra=2)
    q, h = np.array([0.05, -0.08, 0.02]), 1e-6
    difference = [
        (force_and_stiffness(polynomials, q + d)[0] - force_and_stiffness(polynomials, q - d)[0]) / (2 * h) for d in h * np.eye(3)
    ]
    assert np.tril(force_and_stiffness(polynomials, q)[1]) == pytest.approx(np.tril(difference), rel=1e-6, abs=1e-8)


def test_reduced_model_follows_the_full_one_in_the_closed_loop(built):
    model, _ = built
    reduced, full = Simulator(model), Simulator(RobotModel(model.robot), reduced=False)
    controller, target = InverseController(model.robot), straight_target(model.length, tip_direction_weight=1e-3)
    angles = np.radians(0.9) * np.arange(70)  # 90 deg/s
    steps_reduced, displacement = 0, None
    for angle in angles:
        gravity = 9.81 * np.array([-np.cos(angle), 0.6 * np.sin(angle), -0.8 * np.sin(angle)])
        shape, exact = reduced.step(gravity, displacement), full.step(gravity, displacement)
        command = controller.step(shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension)
        displacement = command.displacement
        assert np.linalg.norm(shape.tip_position - exact.tip_position) < 0.1e-3  # the tolerance; the training is short
        steps_reduced += shape.model == "reduced"
    assert steps_reduced > 60
    largest = np.abs(exact.response.compliance_ea).max()
    assert shape.response.compliance_ea == pytest.approx(exact.response.compliance_ea, abs=0.02 * largest)
    assert shape.tip_orientation == pytest.approx(exact.tip_orientation, abs=1e-3)
    assert 0.0 < shape.error_estimate < 0.1e-3  # measured by now


def test_slack_is_entered_and_left_without_chatter(built):
    """Pulling one cable of the upright robot in and out again, it and the one opposite go taut and slack once each."""
    model, _ = built
    simulator = Simulator(model)
    pull = 1.5e-3 * np.sin(np.linspace(0.0, np.pi, 61))
    shapes = [simulator.step([0.0, 0.0, -9.81], displacement=np.array([p, 0, 0, 0, 0, 0])) for p in pull]
    assert {(shape.model, shape.status) for shape in shapes} == {("reduced", ShapeStatus.OK)}
    taut = np.array([shape.cable_tension > 1e-9 for shape in shapes])
    assert np.abs(np.diff(taut.astype(int), axis=0)).sum(axis=0).tolist() == [2, 0, 0, 0, 2, 0]
    # There and back, the shapes agree within the tracker's tolerance, 5e-5 of the length.
    tips = np.array([shape.tip_position for shape in shapes])
    assert tips[:30] == pytest.approx(tips[:30:-1], abs=1e-5)


def test_reduction_serves_other_moduli_in_its_range_and_no_others(built):
    model, _ = built
    softer = RobotModel(model.robot.with_material(youngs_modulus=0.65e6))
    assert path_of(softer) == path_of(model)
    gravity = np.array([-9.81, 0.0, 0.0])
    simulator = Simulator(softer)
    shape = [simulator.step(gravity) for _ in range(2)][-1]
    assert shape.model == "reduced"
    exact = Simulator(softer, reduced=False).solve(gravity)
    assert np.linalg.norm(shape.tip_position - exact.tip_position) < 0.3e-3
    assert load(RobotModel(model.robot.with_material(youngs_modulus=0.4e6))) is None
    assert load(RobotModel(model.robot.with_material(poissons_ratio=0.4))) is None


def test_the_full_model_is_used_out_of_range_and_the_reduced_one_again_afterwards(built):
    model, _ = built
    simulator = Simulator(model)
    simulator.step(np.array([-9.81, 0.0, 0.0]))
    heavy = np.array([-60.0, 0.0, 0.0])
    shape = simulator.step(heavy)
    exact = Simulator(RobotModel(model.robot), reduced=False).solve(heavy)
    assert (shape.model, shape.status) == ("full", ShapeStatus.FALLBACK)
    assert "full model is used" in shape.message
    assert shape.tip_position == pytest.approx(exact.tip_position, abs=1e-5)
    models = [simulator.step(np.array([-9.81, 0.0, 0.0])).model for _ in range(60)]
    assert models[-1] == "reduced"


@pytest.mark.parametrize("asked", [True, False], ids=["when asked", "with the next step"])
def test_the_error_is_measured_after_a_step_as_in_it(built, asked):
    """The memory of a body that creeps is that from which the step was taken."""
    robot = built[0].robot.with_material(prony=(PronyTerm(0.1, 0.3), PronyTerm(0.1, 6.0)))
    within, after = Simulator(robot), Simulator(robot)
    error = after._serving.reduced.error
    measured = 0
    for share in np.linspace(0.0, 1.0, 61):
        gravity = 9.81 * np.array([np.sin(np.pi / 2 * share), 0.0, -np.cos(np.pi / 2 * share)])
        shape, own = within.step(gravity, duration=0.01), after.step(gravity, duration=0.01, later=True)
        assert own.tip_position == pytest.approx(shape.tip_position, abs=1e-12)
        if shape.error_estimate != error:  # measured in this step
            assert (own.model, own.error_estimate) == ("reduced", error)
            measured, error = measured + 1, shape.error_estimate
            if asked:
                after.measure_error()
                assert after._serving._error == pytest.approx(error, rel=1e-6)
                error = within._serving._error = after._serving._error
            else:
                again = after.step(gravity, duration=0.01)
                assert again.error_estimate == pytest.approx(error, rel=1e-6)
                within.step(gravity, duration=0.01)
                error = within._serving._error = after._serving._error
    assert measured >= 2 and within._serving.trusted


_LOADED_IN_THE_LOOP = """
import pickle, sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from gravcomp.simulation import DynamicSimulator, Simulator

def loaded():
    modules = [module for name, module in sys.modules.items() if name.startswith("gravcomp")]
    found = [(m.__name__, name, f) for m in modules for name, f in vars(m).items() if isinstance(f, Dispatcher)]
    return {(module, name): len(f.overloads) for module, name, f in found}

robot = pickle.load(sys.stdin.buffer)
for kind, more in (Simulator, {"later": True}), (DynamicSimulator, {}):
    simulator = kind(robot)
    simulator.warm_up()
    simulator.reset()
    models, before = set(), loaded()
    for gravity in [9.81] * 40 + [60.0]:
        models.add(simulator.step(np.array([-gravity, 0.0, 0.0]), np.zeros(len(robot.cables)), duration=0.01, **more).model)
        getattr(simulator, "measure_error", bool)()
    assert models == {"reduced", "full"}, models
    after = loaded()
    print(kind.__name__, *(name for name in after if after[name] > before.get(name, 0)))
"""


def test_no_compiled_function_is_loaded_after_the_warm_up(built):
    """Neither for the first measured error nor where the full model takes over: loading takes as long as several samples."""
    robot = pickle.dumps(built[0].robot)
    done = subprocess.run([sys.executable, "-c", _LOADED_IN_THE_LOOP], input=robot, capture_output=True, check=False)
    assert done.stdout.decode().split() == ["Simulator", "DynamicSimulator"], done.stderr.decode()


@pytest.mark.parametrize("later", [False, True])
def test_a_large_measured_error_ends_the_use_of_the_reduced_model(built, later):
    model, _ = built
    simulator = Simulator(model)
    serving = simulator._serving
    # Elasticity of a body that is 30 % stiffer.
    wrong = dataclasses.replace(serving.reduced.elasticity, linear=1.14 * serving.reduced.elasticity.linear)
    serving = simulator._serving = ReducedServing(model, dataclasses.replace(serving.reduced, elasticity=wrong), simulator.solver)
    models = [simulator.step(np.array([-9.81, 0.0, 0.0]), later=later).model for _ in range(40)]
    assert models[-1] == "full"
    assert "the tip error of the reduced model is" in serving.reason


@pytest.mark.parametrize(("motion", "times"), [("gravity", 5), ("cables", 2)])
def test_the_error_is_measured_again_after_a_motion_however_long_the_reach_is(built, motion, times):
    """A soft robot falls over when its cables are released: shapes that are held are near by, compared with that."""
    model, _ = built
    simulator = Simulator(model)
    serving = simulator._serving
    far = dataclasses.replace(serving.reduced, reach=1e3 * serving.reduced.reach)
    serving = simulator._serving = ReducedServing(model, far, simulator.solver)
    measured, measure = [], serving._measured_error
    serving._measured_error = lambda *given: measured.append(given) or measure(*given)
    wound = np.zeros(model.tendons.count)
    for share in np.linspace(0.0, 1.0, 101):
        angle = np.pi / 2 * share if motion == "gravity" else 0.0
        wound[0] = 0.05 * model.length * share if motion == "cables" else 0.0
        simulator.step(9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)]), wound)
    assert len(measured) == times


def test_a_robot_of_linear_tetrahedra_is_refused_with_the_reason(robot, cache):
    linear = RobotModel(robot, tube_mesh(robot, "tet4"))
    assert "corotational" in why_not(linear)
    with pytest.raises(MeshError, match="full model is used"):
        build(linear, SMALL)


@pytest.fixture(scope="module")
def soft():
    """The model of a short thick arm of very soft silicone, which loses its equilibrium on many paths."""
    silicone = Material(youngs_modulus=0.15e6, poissons_ratio=0.49, density=1070.0)
    cables = tuple(Cable(f"c{i}", i * 2.0 * np.pi / 3.0, 7e-3, segment="arm") for i in range(3))
    arm = Segment("arm", 0.12, 20e-3, 8e-3, material=silicone)
    return RobotModel(Robot("soft", segments=(arm,), cables=cables, elements=Elements(around=6, along=6)))


def test_the_training_halves_steps_of_gravity_and_cables_where_a_soft_robot_loses_its_equilibrium(soft):
    found = samples(soft, TrainingOptions(paths=1, steps=12, seed=3))
    assert len(found) >= 10  # 8 when only gravity goes back


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_training_has_shapes_that_a_very_soft_robot_is_held_in(soft, seed, monkeypatch):
    """Released it lies down; its winches need many steps to bring it back, so gravity waits for them."""
    model = RobotModel(soft.robot.with_material(youngs_modulus=0.06e6))
    module = sys.modules["gravcomp.training.samples"]
    targets, rest_target = [], module.rest_target
    monkeypatch.setattr(module, "rest_target", lambda *args, **kinds: targets.append(rest_target(*args, **kinds)) or targets[0])
    last = samples(model, TrainingOptions(paths=1, steps=12, seed=seed))[-1]
    u = np.zeros_like(model.mesh.nodes)
    model.free(u)[:] = last.unknowns
    away = model.effectors.sections(model.mesh.nodes + u)[-1, 0] - targets[0].tip_position
    assert np.degrees(np.arccos(last.gravity[2] / np.linalg.norm(last.gravity))) > 60.0  # from where it hangs
    assert np.linalg.norm(away[:2]) < 0.1 * model.length  # 0.5 to 0.8 where gravity turns on


def test_a_path_begins_with_the_hanging_robot_where_one_search_finds_no_equilibrium(soft, monkeypatch):
    gravity = 2.0 * 9.81 * np.array([0.17, 0.0, -0.98])  # nearly upright: the tip sinks to the side
    hanging = [0.0, 0.0, np.linalg.norm(gravity)]
    factors, factor = [], BlockMatrix.factor
    monkeypatch.setattr(BlockMatrix, "factor", lambda matrix: factors.append(None) or factor(matrix))
    begun, searched = StaticSolver(soft), StaticSolver(soft)
    assert _start(begun, gravity) == pytest.approx(hanging) and begun.state.converged
    few = len(factors)
    assert searched.solve(gravity, CableInput()).converged and len(factors) - few > 3 * few
    monkeypatch.setattr(sys.modules["gravcomp.training.samples"], "_direction", lambda rng: gravity / np.linalg.norm(gravity))
    found = samples(soft, TrainingOptions(paths=1, steps=8, seed=3))
    turned = np.degrees([np.arccos(sample.gravity @ gravity / np.linalg.norm(sample.gravity) / hanging[2]) for sample in found])
    assert len(found) >= 6 and turned[0] == pytest.approx(170.0, abs=1.0)
    way = np.diff(turned[: int(np.argmin(turned)) + 1])  # then it turns about the wanted direction, which is the only one here
    assert (way <= 0.0).all() and (way > -30.1).all() and len(way) >= 6  # in steps


@pytest.mark.parametrize(
    ("law", "represented", "size", "strains"),
    [("svk", 1e-9, 7, 2), ("svk", 1.0, 4, 2), ("neo_hookean", 1e-9, 7, 5), ("neo_hookean", 1.0, 4, 2)],
)
def test_there_are_more_modes_where_the_others_do_not_represent_the_shapes_and_more_strains_with_them(
    robot, monkeypatch, law, represented, size, strains
):
    model = RobotModel(robot.with_material(law=law))
    shapes = 1e-4 * model.length * np.random.default_rng(0).normal(size=(12, 3 * model.n_free))
    none = np.zeros(model.tendons.count)
    found = [Sample(shape, np.zeros(3), none, none, np.zeros(7)) for shape in shapes]
    monkeypatch.setattr(sys.modules["gravcomp.training.build"], "samples", lambda *args, **turns: found)
    options = BuildOptions(modes=4, more_modes=3, strains=2, more_strains=3, represented=represented, integrated=2)
    assert trained(model, options).elasticity.linear.shape == (size, size + strains)


@pytest.mark.parametrize(
    ("earlier", "new", "ends"),
    [(range(6), range(6), True), (range(3), range(3, 6), False), (range(6), range(12), True)],
    ids=["the same shapes", "others, which the modes have room for", "more than the modes have room for"],
)
def test_the_training_ends_where_more_paths_would_not_help(robot, monkeypatch, earlier, new, ends):
    model = RobotModel(robot.with_material(law="svk"))
    rng, none, asked = np.random.default_rng(0), np.zeros(model.tendons.count), []
    kinds = 1e-4 * model.length * rng.normal(size=(12, 3 * model.n_free))

    def found(of: range) -> list[Sample]:
        shapes = rng.normal(size=(14, len(of))) @ kinds[list(of)]
        return [Sample(shape, np.zeros(3), none, none, np.zeros(7)) for shape in shapes]

    def asking(*args, **turns):
        asked.append(args[-1](found(earlier), found(new)))
        return found(new)

    monkeypatch.setattr(sys.modules["gravcomp.training.build"], "samples", asking)
    monkeypatch.setattr("gravcomp.training.modes.symmetries", lambda model: [])
    trained(model, BuildOptions(modes=4, more_modes=3, strains=2, represented=1e-6, integrated=2))
    assert asked == [ends]


def test_a_reduction_is_as_small_as_serves_nearly_all_shapes_that_the_whole_serves(built, monkeypatch):
    model, reduction = built
    r = reduction.basis.shape[1]
    elasticity = reduction.elasticity
    more = StrainPolynomials(*(np.hstack([table, table[:, -12:]]) for table in (elasticity.linear, elasticity.quadratic)))
    whole = dataclasses.replace(reduction, elasticity=more)
    strains, asked = more.linear.shape[1] - r, []

    def served(least: tuple[int, int], of: int, count: int):
        """Errors of a reduced model that serves `count` of the whole's `of` shapes with `least` modes and strains."""

        def tip_errors(model, part, samples):
            size, extra = part.size, part.elasticity.linear.shape[1] - part.size
            asked.append((size, extra))
            last = of if (size, extra) == (r, strains) else count if size >= least[0] and extra >= least[1] else 0
            return np.array([0.0 if number < last else np.inf for number in samples])

        return tip_errors

    def size(least: tuple[int, int], count: int) -> tuple[int, int]:
        monkeypatch.setattr("gravcomp.training.smallest.tip_errors", served(least, 100, count))
        part = smallest(model, whole, list(range(110)), r - 8, 1e-4)
        return part.basis.shape[1], part.elasticity.linear.shape[1] - part.basis.shape[1]

    assert size((r - 8, 4), 95) == (r - 8, 4)
    assert size((r - 4, 8), 95) == (r - 4, 8)
    assert size((r - 8, 4), 94) == (r, strains)  # too few of them
    assert asked.count((r - 8, 4)) == 11 + 2 + 11  # a part that cannot serve enough any more is left
    monkeypatch.setattr("gravcomp.training.smallest.tip_errors", served((r - 8, 4), 54, 54))
    assert smallest(model, whole, list(range(110)), r - 8, 1e-4) is whole  # the shapes show too little
    assert size((r - 4, 8), 100) == (r - 4, 8) and elasticity.of_first(r - 4, 8).linear.shape == (r - 4, r + 4)


@pytest.mark.parametrize("extra", [4, 12])
def test_a_part_of_a_reduced_model_is_that_of_its_first_modes_and_strains(built, extra):
    model, reduction = built
    whole, modes = reduction.reduced_model(model), reduction.basis.shape[1] - 4
    part, stored = whole.of_first(modes, extra), reduction.of_first(modes, extra).reduced_model(model)
    q = np.random.default_rng(0).normal(size=modes)
    q *= 0.1 * whole.reach / np.linalg.norm(q)
    points = [point_at(body_of(of), q, np.ones(6)) for of in (part, stored)]
    assert points[0].jacobian == pytest.approx(points[1].jacobian, rel=1e-6, abs=1e-9)
    assert points[0].tendons.displacement == pytest.approx(points[1].tendons.displacement, abs=1e-9)
    assert part.tip(q) == pytest.approx(whole.tip(np.append(q, np.zeros(4))), abs=1e-12)
    assert part.tip(q) == pytest.approx(stored.tip(q), abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "material"),
    [("tet10", {"poissons_ratio": 0.4999}), ("hex20", {"fibres": Fibres(5.0, 0.5)})],
    ids=["mean pressure", "fibres"],
)
def test_polynomials_hold_the_mean_pressure_of_tetrahedra_and_the_fibres(robot, kind, material):
    robot = robot.with_material(**material)
    model = RobotModel(robot, tube_mesh(robot, kind))
    matrix = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), matrix)
    x, y, z = model.mesh.nodes[: model.n_free].T / model.length
    raw = np.array([np.stack(f, axis=1).ravel() for f in ((z**2, 0 * z, -2 * x * z), (-y * z, x * z, 0 * z), (x, y, z))])
    basis = energy_basis(raw, matrix.multiply, 3)
    shapes = np.random.default_rng(0).normal(size=(30, 3)) @ (0.1 * basis.T)
    polynomials = strain_polynomials(model.elements, basis, shapes, extra=6)
    q = 0.1 * np.random.default_rng(1).normal(size=3)
    u = np.zeros_like(model.mesh.nodes)
    model.free(u)[:] = basis @ q
    matrix.values[:] = 0.0
    force = basis.T @ model.free(model.elements.assemble(u, matrix))
    own_force, own_stiffness = force_and_stiffness(polynomials, q)
    assert own_force == pytest.approx(force, rel=1e-5, abs=1e-8)
    assert np.tril(own_stiffness) == pytest.approx(np.tril(basis.T @ matrix.multiply(basis)), rel=1e-5, abs=1e-6)


def with_law(modes, law: str):
    """The model of another law on the same three modes; its polynomials of all strains; its cubature of all points."""
    model, _, basis, shapes = modes
    model = RobotModel(model.robot.with_material(law=law))
    element, point = (index.ravel() for index in np.indices(model.elements.weights.shape))
    every = Cubature(element, point, model.elements.weights.ravel())
    return model, strain_polynomials(model.elements, basis, shapes, extra=6), every.deviation(model.elements, basis)


@pytest.mark.parametrize("law", ["neo_hookean", "mooney_rivlin", "yeoh"])
def test_with_all_points_forces_and_stiffness_of_a_law_are_those_of_the_elements(modes, law):
    model, polynomials, deviation = with_law(modes, law)
    _, _, basis, _ = modes
    matrix = model.new_matrix()
    for q in 0.1 * np.random.default_rng(1).normal(size=(3, 3)):
        u = np.zeros_like(model.mesh.nodes)
        model.free(u)[:] = basis @ q
        matrix.values[:] = 0.0
        force = basis.T @ model.free(model.elements.assemble(u, matrix))
        own_force, own_stiffness = force_and_stiffness(polynomials, q)
        at = deviation_at(deviation, q)
        add_deviation_stiffness(deviation, at, own_stiffness)
        assert np.abs(at.force).max() > 1e-4 * np.abs(own_force).max()
        assert own_force + at.force == pytest.approx(force, rel=1e-6, abs=1e-8)
        assert np.tril(own_stiffness) == pytest.approx(np.tril(basis.T @ matrix.multiply(basis)), rel=1e-5, abs=1e-6)


def test_few_points_with_positive_weights_carry_the_deviation(modes):
    model, _, every = with_law(modes, "neo_hookean")
    _, _, basis, _ = modes
    coordinates = 0.1 * np.random.default_rng(2).normal(size=(40, 3))
    sections, compliance = section_changes(model, basis)[:, 0] / model.length, np.tile(np.eye(3), (40, 1, 1))

    def chosen(tolerance: float, room: int, compliance: np.ndarray = compliance) -> Cubature:
        return choose(model.elements, basis, coordinates, compliance, sections, tolerance, room)

    rough, fine = (chosen(tolerance, 999) for tolerance in (1e-3, 3e-5))
    assert 0 < len(rough.weight) < len(fine.weight) < model.elements.weights.size / 2
    assert (fine.weight > 0.0).all() and fine.error <= 3e-5 < rough.error <= 1e-3
    # Where a number of points is enough, twice the error is allowed; where it is not, the error counts.
    every_point, enough = (chosen(3e-5, few) for few in (1, len(fine.weight) - 1))
    assert every_point.error <= 3e-5 and len(enough.weight) <= len(fine.weight) and enough.error <= 6e-5
    few, largest = fine.deviation(model.elements, basis), np.abs(deviation_at(every, coordinates[0]).force).max()
    for q in 0.1 * np.random.default_rng(3).normal(size=(5, 3)):  # not chosen with these
        assert deviation_at(few, q).force == pytest.approx(deviation_at(every, q).force, abs=0.05 * largest)


def test_forces_that_are_in_error_where_a_shape_is_stiff_move_nothing(modes):
    model, _, _ = with_law(modes, "neo_hookean")
    _, _, basis, _ = modes
    coordinates = 0.1 * np.random.default_rng(2).normal(size=(40, 3))
    sections, soft = section_changes(model, basis)[:, 0] / model.length, np.tile(np.eye(3), (40, 1, 1))
    stiff = soft @ np.diag([1.0, 1e-3, 1e-3])
    of_soft, of_stiff = (
        choose(model.elements, basis, coordinates, compliance, sections, 3e-5, 999) for compliance in (soft, stiff)
    )
    assert len(of_stiff.weight) < 0.8 * len(of_soft.weight) and of_stiff.error <= 3e-5


def test_points_are_chosen_where_a_body_is_so_stiff_that_its_part_is_rounding_error(modes):
    """As those of a rod of metal between soft disks."""
    model, _, _ = with_law(modes, "neo_hookean")
    _, _, basis, _ = modes
    coordinates, turn = 0.1 * np.random.default_rng(2).normal(size=(40, 3)), Rotation.random(40, rng=5).as_matrix()
    compliance = turn @ np.diag([1.0, 1e-20, 1e-20]) @ turn.swapaxes(1, 2)
    chosen = choose(model.elements, basis, coordinates, compliance, section_changes(model, basis)[:, 0], 1e-3, 999)
    assert len(chosen.weight) and chosen.error <= 1e-3


def test_the_compliance_of_a_sample_is_that_of_the_full_model(built):
    """A force on the modes moves the equilibrium by it, tensions given; at rest it is the identity."""
    model, reduction = built
    basis, none, gravity = reduction.basis, np.zeros(model.tendons.count), np.array([-9.81, 0.0, 0.0])
    at_rest = Sample(np.zeros(3 * model.n_free), np.zeros(3), none, none, np.zeros(7))
    tension = np.linspace(0.3, 0.0, len(none))
    shapes = [Simulator(model.robot, reduced=False) for _ in range(2)]
    for simulator, pull in zip(shapes, (gravity, gravity * 1.001)):
        simulator.solver.tolerance = 1e-9 * model.length
        assert simulator.solve(pull, tension=tension).is_equilibrium
    bent, moved = (model.free(simulator.displacements).copy() for simulator in shapes)
    rest, found = compliances(model, basis, [at_rest, Sample(bent, gravity, tension, none, np.zeros(7))])
    assert rest == pytest.approx(np.eye(len(rest)), abs=1e-8)
    force = basis.T @ np.kron(model.nodal_weight[: model.n_free], 1e-3 * gravity)
    wanted = section_changes(model, (moved - bent)[:, None])[-1, 0, :, 0]
    assert section_changes(model, basis)[-1, 0] @ found @ force == pytest.approx(wanted, abs=0.02 * np.linalg.norm(wanted))
    assert np.linalg.norm(section_changes(model, basis)[-1, 0] @ force - wanted) > 0.05 * np.linalg.norm(wanted)


def test_twice_the_error_is_enough_where_the_points_fill_the_room_of_the_board():
    columns = np.random.default_rng(4).random((30, 60))
    total = columns @ np.ones(60)

    def count(allowed: float, room: int) -> tuple[int, float]:
        index, _, left = sparse_weights(columns.T @ columns, columns.T @ total, total @ total, allowed, room)
        return len(index), left

    allowed = 0.02 * np.linalg.norm(total)
    (most, within), (fewest, rough) = count(allowed, 999), count(2.0 * allowed, 999)
    assert fewest < most and within <= allowed < rough <= 2.0 * allowed
    # Where there is room for fewer only, the error counts.
    assert count(allowed, fewest) == (fewest, rough) and count(allowed, fewest - 1) == (most, within)


def test_half_of_the_error_is_left_where_few_points_do_so():
    columns = np.random.default_rng(4).random((30, 60))
    total = columns @ np.ones(60)
    allowed = 0.02 * np.linalg.norm(total)

    def count(few: int) -> tuple[int, float]:
        index, _, left = sparse_weights(columns.T @ columns, columns.T @ total, total @ total, allowed, 999, few)
        return len(index), left

    (fewest, rough), (most, within) = count(0), count(999)
    assert fewest < most and within <= 0.5 * allowed < rough <= allowed
    # Beyond the few the whole error may be left.
    assert count(fewest) == (fewest, rough) and count(most) == (most, within)


def test_a_reduced_hyperelastic_body_with_cable_friction_follows_the_full_one(robot, cache):
    cables = tuple(dataclasses.replace(cable, friction=1.0) for cable in robot.cables)
    model, reduction = built_once(dataclasses.replace(robot, cables=cables).with_material(law="yeoh"))
    assert 0 < len(reduction.cubature.weight) < model.elements.weights.size
    reduced, full = Simulator(model), Simulator(RobotModel(model.robot), reduced=False)
    without = Simulator(robot.with_material(law="yeoh"), reduced=False)
    controller, target = InverseController(model.robot), straight_target(model.length, tip_direction_weight=1e-3)
    served, displacement, apart = 0, None, []
    for angle in np.radians(0.9) * np.arange(70):
        gravity = 9.81 * np.array([-np.cos(angle), 0.6 * np.sin(angle), -0.8 * np.sin(angle)])
        shape, exact = reduced.step(gravity, displacement), full.step(gravity, displacement)
        apart.append(np.linalg.norm(without.step(gravity, displacement).tip_position - exact.tip_position))
        command = controller.step(shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension)
        displacement = command.displacement
        assert np.linalg.norm(shape.tip_position - exact.tip_position) < 0.1e-3
        served += shape.model == "reduced"
    assert served > 60
    assert shape.cable_tension == pytest.approx(exact.cable_tension, abs=0.01 * exact.cable_tension.max())
    assert max(apart) > 0.05e-3  # what friction changes


def test_the_full_model_is_used_where_the_robot_is_near_itself(built):
    """A robot of this length cannot come near itself: the test pretends that it does."""
    simulator, gravity = Simulator(built[0], scene=scene_of(self_contact=True)), np.array([-9.81, 0.0, 0.0])
    assert simulator.step(gravity).model == "reduced"
    simulator._serving._itself.at = lambda q: True
    shape = simulator.step(0.9 * gravity)
    assert (shape.model, shape.status) == ("full", ShapeStatus.FALLBACK) and "touches itself, or nearly" in shape.message
    assert simulator.step(0.8 * gravity).model == "full"
    del simulator._serving._itself.at
    for _ in range(30):
        shape = simulator.step(0.8 * gravity)
    assert shape.model == "reduced"


@pytest.fixture(scope="module")
def rubber(robot, cache):
    """A model of a law of rubber that hardly changes its volume, and its reduction."""
    return built_once(robot.with_material(law="neo_hookean", poissons_ratio=0.49))


@pytest.mark.parametrize(("body", "table_mm"), [("built", None), ("rubber", None), ("built", -40.0)])
def test_the_response_is_that_of_an_equilibrium_however_far_the_step(body, table_mm, request):
    """Also in a scene whose table the robot does not reach."""
    table = table_mm and scene_of(planes=[{"name": "table", "normal": [1, 0, 0], "point_mm": [table_mm, 0, 0]}])
    simulator = Simulator(request.getfixturevalue(body)[0], scene=table)
    simulator.step(9.81 * np.array([0.0, 0.0, -1.0]))
    for angle in (20.0, 40.0, 60.0):
        gravity = 9.81 * np.array([-np.sin(np.radians(angle)), 0.0, -np.cos(np.radians(angle))])
        far, near = simulator.step(gravity), simulator.step(gravity)
        assert far.model == near.model == "reduced"
        for name in ("compliance_ea", "compliance_aa"):
            expected = getattr(near.response, name)
            assert getattr(far.response, name) == pytest.approx(expected, abs=0.05 * np.abs(expected).max())


def test_a_rubber_body_that_turns_fast_stays_with_the_reduced_model(rubber):
    simulator, controller = Simulator(rubber[0]), InverseController(rubber[0].robot)
    target, displacement = straight_target(rubber[0].length), None
    for angle in np.radians(2.0) * np.arange(60):
        shape = simulator.step(9.81 * np.array([-np.cos(angle), np.sin(angle), 0.0]), displacement)
        assert shape.model == "reduced"
        command = controller.step(shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension)
        displacement = command.displacement


def test_reduced_cables_with_friction_are_the_full_models(robot, modes):
    _, _, basis, shapes = modes
    cables = tuple(dataclasses.replace(cable, friction=0.5) for cable in robot.cables)
    model = RobotModel(dataclasses.replace(robot, cables=cables))
    polynomials = strain_polynomials(model.elements, basis, shapes, extra=2)
    reduced = project(model, basis, polynomials, Cubature.none(), reach=1.0, error=0.0)
    q, pulling, tension = np.array([0.3, -0.2, 0.1]), np.array([1.0, -1.0, 0.0, 1.0, 1.0, -1.0]), np.linspace(0.5, 2.0, 6)
    u = np.zeros_like(model.mesh.nodes)
    model.free(u)[:] = basis @ q
    own, exact = tendons_at(reduced.cables, q, pulling), model.tendons.state(model.mesh.nodes + u, pulling)
    assert exact.share.min() < 0.98 and exact.share.max() > 1.02
    single = np.finfo(np.float32).eps  # the precision of what each coordinate changes
    assert own.share == pytest.approx(exact.share, rel=single)
    for found, of in ((own.jacobian, exact.jacobian @ basis), (own.force_jacobian, exact.force_jacobian @ basis)):
        assert found == pytest.approx(of, abs=single * np.abs(of).max())
    matrix, stiffness = model.new_matrix(), np.zeros((3, 3))
    model.tendons.add_stiffness(exact, tension, matrix)
    add_stiffness(reduced.cables, own, tension, stiffness)
    assert np.tril(stiffness) == pytest.approx(np.tril(basis.T @ matrix.multiply(basis)), rel=1e-6, abs=1e-9)


def test_a_reduced_body_creeps_as_the_full_one_and_hands_its_memory_over(built):
    """Gravity turns for a second, rests for twenty, and the reduced model is left and taken up again in between."""
    prony = (PronyTerm(0.08, 0.3), PronyTerm(0.12, 6.0))
    model, robot = built[0], built[0].robot.with_material(prony=prony)
    reduced, full = Simulator(robot), Simulator(robot, reduced=False)
    relaxed = Simulator(model)
    gravity = 9.81 * np.array([0.0, 0.0, -1.0])
    shapes = [simulator.step(gravity) for simulator in (reduced, full)]
    models, apart, left = [], [], np.inf
    for step in range(110):
        angle = 0.5 * np.pi * min(1.0, step / 20)
        gravity = 9.81 * np.array([-np.sin(angle), 0.0, -np.cos(angle)])
        if step == 40:
            reduced._serving._leave("for the test", wait=10)
        shapes = [s.step(gravity, duration=0.05 if step < 60 else 0.4) for s in (reduced, full)]
        models.append(shapes[0].model)
        apart.append(np.linalg.norm(shapes[0].tip_position - shapes[1].tip_position))
        if step == 20:
            left = np.linalg.norm(shapes[1].tip_position - relaxed.step(gravity).tip_position)
    assert left > 2e-3  # what is still to creep when gravity has turned
    assert models[39] == "reduced" and models[45] == "full" and models[-1] == "reduced"
    assert max(apart) < 0.1e-3
    assert np.linalg.norm(shapes[0].tip_position - relaxed.step(gravity).tip_position) < 0.1 * left


@pytest.mark.parametrize("damping", ["kelvin_voigt", "rayleigh"])
def test_reduced_motion_is_the_full_models(built, damping):
    """Let go from its equilibrium upside down, cables held, the robot swings; every step is the reduced model's."""
    model, _ = built
    options = DynamicsOptions(damping=damping, rayleigh_mass=1.0, rayleigh_stiffness=0.02)
    movers = DynamicSimulator(model, options), DynamicSimulator(model, options, reduced=False)
    for mover in movers:
        mover.settle([0.0, 0.0, 9.81], np.zeros(6))
    turned = 9.81 * np.array([-0.6, 0.3, 0.7])
    tips = []
    for _ in range(40):
        own, exact = (mover.step(turned, np.zeros(6)) for mover in movers)
        assert (own.model, own.status, exact.model) == ("reduced", ShapeStatus.OK, "full")
        tips.append((own.tip_position, exact.tip_position))
    own, exact = np.array(tips).transpose(1, 0, 2)
    assert np.ptp(exact, axis=0).max() > 2e-3
    assert np.linalg.norm(own - exact, axis=1).max() < 0.1e-3


def test_motion_beyond_the_trained_range_is_handed_to_the_full_model_and_back(built):
    model, _ = built
    simulator = DynamicSimulator(model)
    exact = DynamicSimulator(model, reduced=False)
    gravity = [np.array([-9.81, 0.0, 0.0])] * 10 + [np.array([-60.0, 0.0, 0.0])] * 10 + [np.array([-9.81, 0.0, 0.0])] * 150
    for mover in (simulator, exact):
        mover.settle(gravity[0])
    models, apart = [], []
    for g in gravity:
        shape = simulator.step(g)
        models.append(shape.model)
        apart.append(np.linalg.norm(shape.tip_position - exact.step(g).tip_position))
    assert (models[5], models[15], models[-1]) == ("reduced", "full", "reduced")
    assert max(apart) < 1e-3 and apart[-1] < 0.1e-3


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_contact_of_the_reduced_model_is_that_of_the_full_one(built, friction):
    """A robot that sags onto a plane: places, forces, how they change with the tensions, and a step along the plane."""
    model, _ = built
    wall = scene_of(planes=[{"name": "table", "normal": [1, 0, 0], "point_mm": [-5.5, 0, 0], "friction": friction}])
    gravity, found = np.array([-9.81, 0.0, 0.0]), []
    for reduced in (False, True):
        simulator = Simulator(model, reduced=reduced, scene=wall, searches=False)
        simulator.solve(gravity)
        for _ in range(3):  # what the basis lacks slides first
            shape = simulator.step(gravity)
        pressing = shape.contacts.by_obstacle()
        moved = simulator.step(gravity + np.array([0.0, 0.05, 0.0]))
        assert shape.model == moved.model == ("reduced" if reduced else "full")
        assert simulator.solver.contact.depth(simulator.displacements) < 2e-5
        found.append((shape, pressing, moved))
        # Where the next step fails, the shape that is kept touches as before.
        lost = simulator.step(gravity, tension=np.array([3e3, 0.0, 0.0, 0.0, 0.0, 0.0]))
        assert not lost.is_equilibrium and lost.contacts.force == pytest.approx(moved.contacts.force, abs=0.0)
    (full, pressing, full_moved), (reduced, own, moved) = found
    assert np.linalg.norm(reduced.tip_position - full.tip_position) < 1e-3 * model.length
    assert own.names == pressing.names == ("table",)
    assert own.force == pytest.approx(pressing.force, rel=5e-2)  # little training
    slid, own_slid = (
        after.contacts.position[-1] - before.contacts.position[-1] for before, after in ((full, full_moved), (reduced, moved))
    )
    if friction:
        assert not moved.contacts.sliding.any() and not full_moved.contacts.sliding.any()
        assert np.linalg.norm(own_slid) < 1e-4 * model.length
    else:
        assert own.change == pytest.approx(pressing.change, abs=0.2 * np.abs(pressing.change).max())
        assert own_slid == pytest.approx(slid, abs=0.1 * np.linalg.norm(slid))
