"""What the virtual robot is where its file does not say it: drawn around the description by a seed."""

import numpy as np
import pytest
import yaml

from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file, shipped_robots
from gravcomp.description import robot as robot_module
from gravcomp.virtual.described import described

ROBOT = {
    "name": "stranger",
    "segments": [
        {
            "name": name,
            "length_mm": 80,
            "outer_diameter_mm": 12,
            "lumen_diameter_mm": 4,
            "material": {"youngs_modulus_mpa": modulus, "poissons_ratio": 0.47, "density": 1120},
        }
        for name, modulus in (("soft", 1.0), ("stiff", 60.0))
    ],
    "cables": [
        {"name": f"c{i}", "angle_deg": 120 * i, "radius_mm": 4.5, "segment": "stiff", "axial_stiffness": 900.0} for i in range(3)
    ],
    "limits": {"tension_max": 40},
}


@pytest.fixture
def stranger(tmp_path):
    """Make a robot file of ROBOT with this section `virtual_robot`, without motors."""

    def make(name="stranger", robot=ROBOT, **virtual):
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump({"robot": robot, "virtual_robot": virtual}), encoding="utf-8")
        return load_robot_file(path)

    return make


def cables_of(count):
    first = ROBOT["cables"][0]
    return [first | {"name": f"c{i}", "angle_deg": 360 / count * i} for i in range(count)]


def moduli(true):
    return np.array([material.youngs_modulus for material in true.robot.materials])


def test_the_same_seed_draws_the_same_robot_and_another_seed_another(stranger):
    file = stranger()
    one, again, other = (described(file, seed).draw() for seed in (5, 5, 6))
    assert one.robot == again.robot
    assert one.drawn == again.drawn
    assert (moduli(one) != moduli(other)).all()
    assert "seed 5" in one.summary()
    assert "modulus" in one.summary()


def test_drawn_values_lie_around_the_described_ones_within_their_spreads(stranger):
    file = stranger()
    ratios, densities, radii, stiffness = [], [], [], []
    for seed in range(60):
        true = described(file, seed).draw()
        ratios.append(moduli(true) / [1e6, 60e6])
        densities.append(true.robot.materials[0].density / 1120.0)
        radii.append([cable.radius / 4.5e-3 for cable in true.robot.cables])
        stiffness.append(true.cables.axial_stiffness / 900.0)
    for values, spread in ((ratios, 0.08), (densities, 0.02), (radii, 0.01), (stiffness, 0.1)):
        off = np.abs(np.array(values) - 1.0)
        assert off.max() <= spread + 1e-12
        assert off.max() > 0.8 * spread
    ratios = np.array(ratios)
    assert abs(np.corrcoef(ratios.T)[0, 1]) < 0.4, "each segment has a modulus of its own"


def test_materials_behave_over_time_as_their_class_does(stranger):
    soft, stiff = described(stranger()).draw().materials
    assert (soft.kind.name, stiff.kind.name) == ("elastomer", "thermoplastic")
    assert sum(soft.creep_ratio) < sum(stiff.creep_ratio) * 1.9


def test_described_creep_is_drawn_around_its_branches(stranger):
    series = [{"share": 0.1, "time_s": 0.5}, {"share": 0.15, "time_s": 40.0}]
    for described_as, ratio, time in (
        ({"prony": series}, np.array([0.1, 0.15]) / 0.75, (0.5, 40.0)),
        ({"creep_ratio": 0.2, "creep_time": 3.0}, np.array([0.2]), (3.0,)),
    ):
        first, *others = ROBOT["segments"]
        segments = [first | {"material": first["material"] | described_as}, *others]
        file = stranger(robot=ROBOT | {"segments": segments})
        for seed in range(3):
            soft, stiff = described(file, seed).draw().materials
            assert soft.creep_time == time
            factor = np.array(soft.creep_ratio) / ratio
            assert np.ptp(factor) < 1e-9 and 0.7 <= factor[0] <= 1.3
            assert stiff.creep_time == stiff.kind.creep_time


def test_a_given_value_wins_and_changes_no_other(stranger):
    free = described(stranger(seed=3)).draw()
    given = described(stranger(seed=3, body={"density": 1000.0}, tendons={"friction": 0.2})).draw()
    assert given.robot.materials[0].density == 1000.0
    assert (given.cables.friction == 0.2).all()
    assert (moduli(given) == moduli(free)).all()
    assert [cable.radius for cable in given.robot.cables] == [cable.radius for cable in free.robot.cables]
    assert (given.motors.backlash == free.motors.backlash).all()


def test_the_shipped_article_gives_all_values_that_decide_its_motion():
    true = described(load_robot_file("article")).draw()
    assert not true.drawn
    assert moduli(true) == pytest.approx(0.75e6)
    assert [c.radius for c in true.robot.cables] == pytest.approx([3.18e-3] * 6)


def test_the_drawn_places_of_all_cables_are_checked_together(stranger, monkeypatch):
    of_three, of_nine = (stranger(f"of_{count}", robot=ROBOT | {"cables": cables_of(count)}) for count in (3, 9))
    checked = []
    check = robot_module.check_crossings
    monkeypatch.setattr(robot_module, "check_crossings", lambda *arguments: checked.append(1) or check(*arguments))
    described(of_three, 3).draw()
    fewer = len(checked)
    described(of_nine, 3).draw()
    assert fewer > 0 and len(checked) == 2 * fewer


def test_cables_at_the_wall_are_drawn_inside_the_body(stranger):
    cables = [cable | {"radius_mm": 6.0} for cable in ROBOT["cables"]]
    for seed in range(5):
        true = described(stranger(robot=ROBOT | {"cables": cables}), seed).draw()
        assert max(cable.radius for cable in true.robot.cables) <= 6e-3 * (1 + 1e-9)


def test_a_robot_without_motors_gets_one_for_each_cable_that_reaches_its_limits(stranger):
    file = stranger()
    hardware = file.hardware
    drive = hardware.drive
    assert drive.tension_limit == 40.0
    assert drive.current_limit * drive.tension_per_ampere > 40.0
    file.require_motors("udp_multicast")
    with pytest.raises(ConfigError, match=r"hardware\.motors.*socketcan"):
        file.require_motors("socketcan")


def test_nine_cables_without_motors_get_two_buses(stranger):
    cables = [{"name": f"c{i}", "angle_deg": 40 * i, "radius_mm": 4.5, "segment": "stiff"} for i in range(9)]
    file = stranger(robot=ROBOT | {"cables": cables})
    hardware = file.hardware
    assert len(hardware.buses) == 2
    assert len(described(file).draw().motors.backlash) == 9


@pytest.mark.parametrize("name", list(shipped_robots()))
def test_every_shipped_robot_has_motors_and_a_virtual_robot(name):
    file = load_robot_file(name)
    file.require_motors("socketcan")
    assert Setup.of(file, 2).true_robot.seed == 2


def test_a_calibrated_file_has_the_virtual_robot_of_its_origin(stranger):
    origin = stranger(seed=4)
    changed = ROBOT | {"segments": [s | {"material": s["material"] | {"youngs_modulus_mpa": 2.0}} for s in ROBOT["segments"]]}
    calibrated = stranger("calibrated", robot=changed, description="stranger.yaml", seed=9)
    assert described(calibrated).draw().robot == described(origin, 9).draw().robot
    setup = Setup.of(calibrated)
    assert setup.robot.materials[0].youngs_modulus == 2e6
    assert setup.nominal == origin.robot


def test_a_single_number_stands_for_a_list_with_it(stranger):
    def bodies(**body):
        return described(stranger(body=body)).draw()

    one, listed = bodies(modulus_ratio=1.1), bodies(modulus_ratio=[1.1])
    assert one.robot == listed.robot and moduli(one) == pytest.approx([1.1e6, 66e6])
    assert bodies(creep_ratio=0.1, creep_time=3).materials[0].creep_time == (3.0,)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"body": {"modulus_ratio": [1.0, 0.9, 0.8]}}, r"modulus_ratio has 3 entries.*2 segments"),
        ({"body": {"modulus_ratio": 200.0}}, r"body\.modulus_ratio is 200.*0.01 to 100"),
        ({"body": {"modulus_ratio": [0.9], "youngs_modulus_mpa": 1.0}}, "both given"),
        ({"body": {"modulus_ratio": [0.0]}}, r"modulus_ratio\[0\] is 0.*0.01 to 100"),
        ({"body": {"creep_ratio": [0.1]}}, "creep_ratio and creep_time belong together"),
        ({"body": {"poissons_ratio": 0.5}}, "poissons_ratio is 0.5"),
        ({"tendons": {"radius_offset_mm": 4.0}}, r"virtual_robot\.tendons describes no robot.*8\.5 mm from the axis"),
        ({"board": {"grade": "perfect"}}, "bmi088, consumer, industrial"),
        ({"description": "article"}, "a robot with the cables s1c1"),
        ({"description": "article", "body": {"density": 1000.0}}, "body cannot be given next to it"),
        ({"description": "nowhere.yaml"}, r"virtual_robot\.description: nowhere.yaml: does not exist"),
        ({"seed": -1}, "seed is -1"),
        ({"segments": []}, "unknown key 'virtual_robot.segments'"),
    ],
)
def test_a_section_that_describes_no_robot_is_refused(stranger, section, message):
    with pytest.raises(ConfigError, match=message):
        described(stranger(**section)).draw()
