"""Gravity from arms: published descriptions against closed forms, accelerations, TF, fusion with the IMU, its mount."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.arm.acceleration import CarriedPoint
from gravcomp.arm.chain import Chain, angle_between, gravity_in
from gravcomp.arm.description import expanded
from gravcomp.arm.frames import FrameTree
from gravcomp.arm.fusion import GravityFusion
from gravcomp.arm.mount import fit_mount
from gravcomp.orientation import EstimatorOptions, GravityEstimator, Problem
from gravcomp.orientation.errors import CalibrationError
from gravcomp.standard_gravity import STANDARD_GRAVITY

QUARTER = math.pi / 2
# Alpha of each joint (rad), from the makers' tables of Denavit-Hartenberg parameters: UR5e (classic), FR3 (Craig's convention).
UR5E_ALPHA = (QUARTER, 0.0, 0.0, QUARTER, -QUARTER, 0.0)
FR3_ALPHA = (0.0, -QUARTER, QUARTER, QUARTER, -QUARTER, QUARTER, QUARTER)
ARMS = {
    "ur5e": ("ur_description", "urdf/ur.urdf.xacro", {"ur_type": "ur5e", "name": "ur", "tf_prefix": "left_"}, "left_tool0"),
    "fr3": ("franka_description", "robots/fr3/fr3.urdf.xacro", {"hand": "false"}, "fr3_link8"),
}


def about(axis: str, angle: float) -> np.ndarray:
    return Rotation.from_euler(axis, angle).as_matrix()


def closed_form(arm: str, angles: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of the flange in the base by the maker's table."""
    result = np.eye(3)
    for alpha, angle in zip(UR5E_ALPHA if arm == "ur5e" else FR3_ALPHA, angles):
        turns = (about("z", angle), about("x", alpha))
        result = result @ (turns[0] @ turns[1] if arm == "ur5e" else turns[1] @ turns[0])
    return result


def urdf_of(arm: str) -> str:
    """Return the published URDF: GRAVCOMP_ARMS/ARM.urdf, else from the package in AMENT_PREFIX_PATH."""
    package, file, arguments, _ = ARMS[arm]
    given = os.environ.get("GRAVCOMP_ARMS")
    if given and (Path(given) / f"{arm}.urdf").is_file():
        return (Path(given) / f"{arm}.urdf").read_text(encoding="utf-8")
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "share" / package / file
        if prefix and path.exists():
            return expanded(path, **arguments)
    pytest.skip(f"neither {package} is installed nor GRAVCOMP_ARMS/{arm}.urdf given")


@pytest.mark.parametrize("arm", ARMS)
def test_gravity_of_a_published_arm_is_that_of_the_makers_table(arm):
    chain = Chain(urdf_of(arm), ARMS[arm][3])
    random = np.random.default_rng(1)
    for _ in range(200):
        angles = random.uniform(-math.pi, math.pi, len(chain.moving))
        expected = gravity_in(closed_form(arm, angles))
        found = chain.gravity(dict(zip(chain.moving, angles)))
        assert math.degrees(angle_between(found, expected)) < 0.1


SLIDE = """<robot name="r"><link name="world"/><link name="a"/><link name="soft_base"/>
<joint name="x" type="prismatic"><parent link="world"/><child link="a"/><axis xyz="1 0 0"/></joint>
<joint name="turn" type="revolute"><parent link="a"/><child link="soft_base"/><axis xyz="0 0 1"/></joint></robot>"""


def test_the_acceleration_of_a_turning_point_is_the_centripetal_one():
    point = CarriedPoint(Chain(SLIDE, "soft_base"), np.array([0.2, 0.0, 0.1]))
    for k in range(30):
        found = point.take(0.004 * k, {"x": 0.0, "turn": 2.0 * 0.004 * k})
    # In soft_base toward the axis, as long as the point turns little within the window.
    np.testing.assert_allclose(found, [-0.2 * 2.0**2, 0.0, 0.0], atol=0.05)


def test_a_gap_or_a_time_that_goes_back_gives_no_acceleration():
    point = CarriedPoint(Chain(SLIDE, "soft_base"), np.zeros(3))
    times = [*(0.004 * k for k in range(20)), 1.0, 0.5]
    found = [point.take(t, {"x": t, "turn": 0.0}) for t in times]
    assert found[18] is not None and found[-2] is None and found[-1] is None


def test_a_fast_arm_does_not_tilt_the_estimate():
    """Horizontal motion at up to 2 m/s^2, with encoder and IMU noise; the arm's acceleration fed forward."""
    step, count = 0.001, 9000
    time = np.arange(count) * step
    phase = np.floor((time - 3.0) / 0.4) % 4
    accel = np.where(time < 3.0, 0.0, np.where((phase == 0) | (phase == 3), 2.0, -2.0))
    accel = np.convolve(accel, np.ones(50) / 50)[:count]  # 50 ms from one acceleration to the other
    place = np.cumsum(np.cumsum(accel)) * step**2
    worst = {}
    for fed in (False, True):
        random = np.random.default_rng(0)
        estimator, point = GravityEstimator(EstimatorOptions()), CarriedPoint(Chain(SLIDE, "soft_base"), np.zeros(3))
        known, angles = np.zeros(3), []
        for i in range(0, count, 2):
            if i % 4 == 0:
                found = point.take(time[i], {"x": place[i] + 1e-5 * random.standard_normal(), "turn": 0.0})
                known = known if found is None else found
            if i % 10 == 0:
                force = np.array([accel[i], 0.0, STANDARD_GRAVITY]) + 0.02 * random.standard_normal(3)
                rate = np.array([0.003, -0.002, 0.001]) + 0.002 * random.standard_normal(3)
                estimate = estimator.update(1 + round(1e9 * time[i]), rate, force, known if fed else np.zeros(3))
                if not isinstance(estimate, Problem) and time[i] > 3.0:
                    angles.append(angle_between(np.array(estimate.gravity), np.array([0.0, 0.0, -1.0])))
        worst[fed] = math.degrees(max(angles))
    assert worst[True] < 0.2 < 0.4 < worst[False]


@pytest.mark.parametrize("arm", ARMS)
def test_a_published_arm_that_moves_at_2_m_s2_tilts_the_estimate_by_less_than_half_a_degree(arm):
    """All joints swing, with joint states at 500 Hz, noise of encoders and IMU, and a bias of the gyroscope."""
    chain, place, random = Chain(urdf_of(arm), ARMS[arm][3]), np.array([0.0, 0.0, 0.05]), np.random.default_rng(1)
    count = len(chain.moving)
    step, rest = 0.002, 2.0  # s
    time = np.arange(0.0, 4.0, step)
    begin = np.clip((time - rest) / 0.5, 0.0, 1.0)[:, None]
    frequencies, amplitudes, middle = random.uniform(0.4, 1.0, count), random.normal(size=count), random.uniform(-1.5, 1.5, count)
    swing = begin**2 * (3.0 - 2.0 * begin) * np.sin(2.0 * math.pi * frequencies * (time - rest)[:, None]) * amplitudes
    scale = 0.1
    for _ in range(3):  # until the fastest moment has 2 m/s^2
        poses = np.array([chain.pose(dict(zip(chain.moving, q))) for q in middle + scale * swing])
        turns, positions = poses[:, :3, :3], poses[:, :3, 3] + poses[:, :3, :3] @ place
        accel = np.gradient(np.gradient(positions, step, axis=0), step, axis=0)
        largest = np.linalg.norm(accel, axis=1).max()
        scale *= 2.0 / largest
    assert largest == pytest.approx(2.0, rel=0.02)
    rates = np.zeros((len(time), 3))
    rates[1:] = Rotation.from_matrix(np.swapaxes(turns[:-1], 1, 2) @ turns[1:]).as_rotvec() / step
    estimator, point, known, angles = GravityEstimator(EstimatorOptions()), CarriedPoint(chain, place), np.zeros(3), []
    for i, (turn, moment) in enumerate(zip(turns, time)):
        joints = middle + scale * swing[i] + 1e-5 * random.standard_normal(count)
        found = point.take(moment, dict(zip(chain.moving, joints)))
        known = known if found is None else found
        if i % 5 == 0:
            force = turn.T @ (accel[i] + [0.0, 0.0, STANDARD_GRAVITY]) + 0.02 * random.standard_normal(3)
            turning = rates[max(0, i - 4) : i + 1].mean(axis=0)
            rate_measured = turning + [0.003, -0.002, 0.001] + 0.002 * random.standard_normal(3)
            estimate = estimator.update(1 + round(1e9 * moment), rate_measured, force, known)
            if not isinstance(estimate, Problem) and moment > rest:
                angles.append(math.degrees(angle_between(np.array(estimate.gravity), gravity_in(turn))))
    assert max(angles) < 0.5


# TF.

UP = np.eye(3)


def tree() -> FrameTree:
    frames = FrameTree("left/soft_base", "world", 0.5)
    frames.take("left/arm", "world", about("x", 0.3), 1.0, 1.0, static=True)
    frames.take("left/soft_base", "left/arm", about("y", 0.2), 1.0, 1.0, static=False)
    return frames


def test_the_rotation_is_the_product_up_to_the_world():
    np.testing.assert_allclose(tree().rotation(1.1), about("x", 0.3) @ about("y", 0.2))


def test_late_missing_and_looping_tf_is_named():
    frames = tree()
    assert frames.rotation(1.6) is None and frames.problem == "the transform of 'left/soft_base' in 'left/arm' is 0.6 s old"
    frames = FrameTree("soft_base", "world", 0.5)
    assert (
        frames.rotation(0.0) is None
        and frames.problem == "'soft_base' is not in TF, so 'soft_base' is not connected with 'world'"
    )
    frames.take("soft_base", "flange", UP, 1.0, 1.0, static=True)
    frames.rotation(1.0)
    assert "'flange' has no parent in TF" in frames.problem and "the frames are flange, soft_base" in frames.problem
    frames.take("flange", "soft_base", UP, 1.0, 1.0, static=True)
    assert frames.rotation(1.0) is None and "are a loop in TF" in frames.problem


def test_an_older_transform_is_not_used():
    frames = tree()
    frames.take("left/soft_base", "left/arm", about("y", 0.9), 0.9, 1.05, static=False)
    np.testing.assert_allclose(frames.rotation(1.1), about("x", 0.3) @ about("y", 0.2))


# Fusion.


def turned(angle: float) -> np.ndarray:
    return STANDARD_GRAVITY * np.array([math.sin(angle), 0.0, -math.cos(angle)])


def fused(fusion: GravityFusion, imu: float, arm: float, duration: float, start: float = 0.0) -> np.ndarray:
    for k in range(round(100 * duration)):
        fusion.arm(start + 0.01 * k, turned(arm))
        result = fusion.imu(start + 0.01 * k, turned(imu))
    return result


def test_the_fused_gravity_is_the_mean_by_the_variances():
    found = fused(GravityFusion(0.02, 0.01, 0.1, 0.5, 0.5), 0.0, 0.05, 6.0)
    assert angle_between(found, turned(0.0)) == pytest.approx(0.8 * 0.05, rel=0.01)
    assert np.linalg.norm(found) == pytest.approx(STANDARD_GRAVITY)


def test_a_lasting_disagreement_leaves_the_imu_alone():
    fusion = GravityFusion(0.02, 0.01, 0.05, 0.5, 0.5)
    fused(fusion, 0.0, 0.0, 1.0)
    fused(fusion, 0.0, 0.2, 0.4, 1.0)
    assert not fusion.disagrees
    found = fused(fusion, 0.0, 0.2, 0.3, 1.4)
    assert fusion.disagrees and angle_between(found, turned(0.0)) == 0.0
    fused(fusion, 0.0, 0.0, 0.1, 1.7)
    assert not fusion.disagrees


def test_without_one_the_other_counts_alone():
    fusion = GravityFusion(0.02, 0.01, 0.1, 0.5, 0.5)
    np.testing.assert_array_equal(fusion.arm(0.0, turned(0.3)), turned(0.3))
    fusion.imu(0.1, turned(0.0))
    assert fusion.arm(0.2, turned(0.3)) is None
    np.testing.assert_array_equal(fusion.imu(5.0, turned(0.1)), turned(0.1))


# Mount.


def rests(count: int, seed: int, noise: float = 0.01, tilt: tuple[float, float] = (0.0, 0.0), mount=(0.3, -1.2, 2.0)):
    random = np.random.default_rng(seed)
    base = Rotation.random(count, rng=random)
    up = Rotation.from_rotvec([*tilt, 0.0]).apply([0.0, 0.0, 1.0])
    accel = STANDARD_GRAVITY * (Rotation.from_euler("xyz", mount).inv() * base.inv()).apply(up)
    return accel + noise * random.standard_normal(accel.shape), base.as_matrix()


def error_of(found, mount=(0.3, -1.2, 2.0)) -> np.ndarray:
    return (found.rotation * Rotation.from_euler("xyz", mount).inv()).as_rotvec()


def test_the_mount_is_found_and_its_interval_holds_it_as_often_as_it_says():
    inside = [np.abs(error_of(found := fit_mount(*rests(8, seed)))) <= found.interval for seed in range(60)]
    assert 0.90 <= np.mean(inside) <= 0.99  # 180 intervals of 95 %
    assert np.abs(error_of(fit_mount(*rests(8, 0)))).max() < math.radians(0.15)


def test_a_tilted_arm_is_found_with_the_mount():
    plain = fit_mount(*rests(12, 1, tilt=(0.03, -0.02)))
    found = fit_mount(*rests(12, 1, tilt=(0.03, -0.02)), with_tilt=True)
    assert np.abs(error_of(found)).max() < math.radians(0.15)
    np.testing.assert_allclose(found.tilt, [0.03, -0.02], atol=2e-3)
    assert plain.residual.max() > 5 * found.residual.max()


@pytest.mark.parametrize(
    ("poses", "tilt", "words"),
    [(1, False, "1 pose"), (2, True, "at least 3 are needed for mount and tilt")],
)
def test_too_few_rests_are_refused(poses, tilt, words):
    with pytest.raises(CalibrationError, match=words):
        fit_mount(*rests(poses, 1), with_tilt=tilt)


def test_rests_along_one_line_are_refused():
    turns = Rotation.from_euler("z", [[0.0], [1.0], [2.0], [3.0]])
    accel = np.tile([0.0, 0.0, STANDARD_GRAVITY], (4, 1))
    with pytest.raises(CalibrationError, match="along one line of soft_base"):
        fit_mount(accel, turns.as_matrix())
