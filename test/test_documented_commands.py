"""Every line that the documents tell the reader to type is run: as it stands, or shortened by the options beside it here.

What a reader puts in himself (FILE, ROBOT.yaml) is given a value, and what a line writes is written into a folder of the test's. Lines for
a CAN device are held to the error that a machine without one gives; those that start other people's programmes are not run.
"""

import functools
import os
import random
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from documents import ROOT, TYPED, documented

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import Ros2, run_node

pytestmark = pytest.mark.timeout(900)

# Not installed by this project.
FOREIGN = ("ros2 launch foxglove_bridge", "ros2 run plotjuggler", "ros2 run robot_state_publisher")
START = 300.0  # s; a machine that has never run the graph compiles first
RECORDED = Path(__file__).parent / "data" / "imu_and_gravity"
WRITTEN_BY_LINES = ("src/README.md", "src/doc/figures.md")


def test_every_line_is_run_by_a_test():
    """A line that a document gains is missing here until a test runs it."""
    sources = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    run = set(re.findall(r"""["']((?:\./gravcomp|ros2) [^"\n]*?)["'](?=[,)\]\s])""", sources)) | set(ROS2_LINES)
    missing = [line for line in TYPED if line not in run and not line.startswith(FOREIGN)]
    assert not missing, "\n".join(missing)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the reader's folder looks like: the repository, but what is written into it stays here."""
    folder = tmp_path_factory.mktemp("repository")
    _mirror(ROOT, folder, [Path(path) for path in WRITTEN_BY_LINES] + [Path("src/doc/pictures/none")])
    for name in ("ROBOT", "my_robot", "left", "right", "robot"):
        shutil.copy(ROOT / "src/gravcomp/robots/article.yaml", folder / f"{name}.yaml")
    return folder


def _mirror(source: Path, target: Path, written: list[Path]) -> None:
    """Links to all that is in `source`; the files `written` and the folders that lead to them are the target's own."""
    target.mkdir(exist_ok=True)
    for path in source.iterdir():
        below = [Path(*w.parts[1:]) for w in written if w.parts[0] == path.name and len(w.parts) > 1]
        if below:
            _mirror(path, target / path.name, below)
        elif Path(path.name) in written:
            shutil.copy(path, target / path.name)
        elif path.name not in (".git", "__pycache__"):
            (target / path.name).symlink_to(path)


@pytest.fixture
def type_in(folder):
    """Types a documented line, `shorter` behind it, and gives the exit code and what was printed."""

    def run(line: str, shorter: str = "", timeout: float = 600.0, **given: object) -> tuple[int, str]:
        done = subprocess.run(
            [*documented(line, **given), *shorter.split()],
            cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=timeout)  # fmt: skip
        return done.returncode, done.stdout

    return run


@pytest.fixture(scope="module")
def recording():
    """An IMU stream with ground truth: BROAD's where there is one; the bag in the repository has none."""
    from gravcomp.recordings.imu.broad_folder import WHERE, broad_files

    files = broad_files()
    if not files:
        pytest.skip(f"no recordings with ground truth. {WHERE}")
    return files[0]


MODEL_LINES = (
    "./gravcomp model info article",
    "./gravcomp model solve article --gravity -9.81 0 0",
    "./gravcomp model solve article --gravity -9.81 0 0 --target 0 0 100",
    "./gravcomp model view article --tension 0 0 0 0.3 0 0 --out bent.png",
    "./gravcomp model info src/examples/own_robot.yaml",
    "./gravcomp model build src/examples/own_robot.yaml",
)


@pytest.mark.parametrize("line", MODEL_LINES)
def test_a_model_is_asked_and_built(type_in, folder, line):
    code, output = type_in(line)
    assert code == 0, output
    assert "--out" not in line or (folder / "bent.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("line", ["./gravcomp doctor", "./gravcomp doctor --robot src/examples/own_robot.yaml"])
def test_the_doctor_looks_at_the_machine(type_in, line):
    code, output = type_in(line)
    # 1 where this machine lacks something that it needs; that is an answer.
    assert code in (0, 1) and "Python" in output


def test_an_own_robot_is_demonstrated(type_in):
    code, output = type_in("./gravcomp demo --robot src/examples/own_robot.yaml", "--duration 12")
    assert code == 0 and "sag without compensation" in output, output


ESTIMATES = ("./gravcomp estimate FILE", "./gravcomp estimate FILE --json", "./gravcomp estimate FILE --out gravity.npz")


@pytest.mark.parametrize("line", ESTIMATES)
def test_gravity_is_estimated_offline(type_in, folder, line):
    code, output = type_in(line, FILE=RECORDED)
    assert code == 0, output
    assert "--out" not in line or (folder / "gravity.npz").exists()


def test_a_robot_is_calibrated_to_measured_tips(type_in, folder):
    from gravcomp.description import load_robot_file
    from gravcomp.simulation import Simulator

    robot = load_robot_file("article").robot.with_material(youngs_modulus=330e3)
    simulator = Simulator(robot)
    rows = [
        "trial,time_s,gravity_x,gravity_y,gravity_z,"
        + ",".join(f"{name}_mm" for name in robot.cable_names)
        + ",tip_x_mm,tip_y_mm,tip_z_mm"
    ]
    for trial, gravity in enumerate(([-9.81, 0.0, 0.0], [0.0, -9.81, 0.0], [-6.9, 0.0, -6.9], [0.0, 6.9, -6.9])):
        tip = 1e3 * simulator.solve(gravity).tip_position
        rows += [",".join(map(str, [trial, 0.05 * k, *gravity, *[""] * len(robot.cables), *tip.round(4)])) for k in range(30)]
    (folder / "measured.csv").write_text("\n".join(rows))
    line = "./gravcomp calibrate DATA.csv --robot ROBOT.yaml --write CALIBRATED.yaml"
    code, output = type_in(line, DATA="measured.csv", ROBOT="ROBOT.yaml", CALIBRATED="calibrated.yaml")
    assert code == 0, output
    # Without cables the tips tell the modulus alone, to within the rounding of a tenth of a micrometre.
    modulus = load_robot_file(str(folder / "calibrated.yaml")).robot.segments[0].material.youngs_modulus
    assert modulus == pytest.approx(330e3, rel=1e-3)


@pytest.mark.parametrize(
    "line, about",
    [
        ("./gravcomp bench engine --write src/README.md", "closed-loop"),
        ("./gravcomp bench estimator", "cost of a sample"),
        ("./gravcomp bench estimator --write src/doc/figures.md", "cost of a sample"),
        ("./gravcomp bench graph", "two robots"),
        ("./gravcomp bench graph --write src/doc/figures.md", "two robots"),
        ("./gravcomp bench page --write src/doc/figures.md", "page"),
        ("./gravcomp bench faults --write src/doc/figures.md", "hostile frames"),
        ("./gravcomp bench soak --write src/doc/figures.md", "lost"),
        ("./gravcomp reproduce static --brief", "recovery rate"),
        ("./gravcomp reproduce all --write src/doc/figures.md", "index"),
    ],
)
def test_figures_are_made(made, line, about):
    """Briefly: whole, they take from minutes to half an hour. What --write does with a document is test_figures_table's."""
    code, output = made(
        tuple(word for word in documented(line) if word not in ("--brief", "--write") and not word.endswith(".md"))
    )
    # 1: a figure was missed, as brief ones may be.
    assert code in (0, 1) and about in output, output


@pytest.fixture(scope="module")
def made(folder):
    """What a command prints with --brief, made once where several lines differ in the document alone that they write to."""

    @functools.cache
    def run(words: tuple[str, ...]) -> tuple[int, str]:
        done = subprocess.run([*words, "--brief"], cwd=folder, capture_output=True, text=True, timeout=800)
        return done.returncode, done.stderr + done.stdout

    return run


@pytest.mark.parametrize(
    "line, shorter",
    [
        ("./gravcomp test", "--collect-only -q"),
        ("./gravcomp test --fast", "--collect-only -q"),
        ("./gravcomp test src/test/test_inverse.py -x", "-k straight"),
    ],
)
def test_tests_are_found(type_in, line, shorter):
    code, output = type_in(line, shorter)
    assert code == 0 and re.search(r"\d+ (tests collected|passed|/)", output), output[-2000:]


@pytest.mark.skipif(Path("/sys/class/net/can0").exists(), reason="there is a can0: motors may hang on it")
@pytest.mark.parametrize(
    "line",
    [
        "./gravcomp up ROBOT.yaml --interface socketcan --channel can0 --viewer",
        "./gravcomp up left.yaml --namespace /left --interface socketcan --channel can0",
        "./gravcomp up right.yaml --namespace /right --interface socketcan --channel can1",
        "./gravcomp up robot.yaml --namespace /soft --interface socketcan --channel can0",
        "./gravcomp doctor --robot ROBOT.yaml --interface socketcan --channel can0",
    ],
)
def test_without_the_can_device_it_is_named(type_in, line):
    code, output = type_in(line, ROBOT="ROBOT.yaml")
    assert code == (1 if "doctor" in line else 2) and re.search(r"can[01]", output), output
    assert "Traceback" not in output


@pytest.mark.skipif(Path("/sys/class/net/can0").exists(), reason="there is a can0: motors may hang on it")
@pytest.mark.parametrize(
    "line",
    [
        "ros2 run gravcomp_hw can_bridge --ros-args -p robot:=my_robot.yaml -p interface:=socketcan -p channel:=can0",
        "ros2 run gravcomp_hw can_bridge --ros-args -p interface:=socketcan -p channel:=can0 -p zero:=home",
    ],
)
def test_a_bridge_without_its_device_names_it(folder, monkeypatch, line):
    documented(line)
    monkeypatch.chdir(folder)
    code, output = run_node(line, dict(os.environ), None)
    assert code == 2 and "can0" in output and "Traceback" not in output


class Shell:
    """A command that runs until Ctrl-C."""

    def __init__(self, words: list[str], cwd: Path, environment: dict[str, str]):
        self.output = cwd / f"output_{random.randrange(10**9)}"
        with open(self.output, "w") as output:
            self.process = subprocess.Popen(
                words, cwd=cwd, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, env=environment,
                start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # fmt: skip

    def wait_for(self, sentence: str) -> None:
        end = time.monotonic() + START
        while sentence not in self.output.read_text():
            assert self.process.poll() is None and time.monotonic() < end, self.output.read_text()
            time.sleep(0.1)

    def ctrl_c(self) -> int:
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(60.0)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise


@pytest.fixture(scope="module")
def domain():
    """A ROS domain of these tests' own, in the environment of whatever they start."""
    before = os.environ.get("ROS_DOMAIN_ID")
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(1, 100))
    yield
    os.environ.pop("ROS_DOMAIN_ID") if before is None else os.environ.update(ROS_DOMAIN_ID=before)


@pytest.fixture(scope="module")
def live(folder, domain):
    """A virtual robot that runs as the tutorial says."""
    shell = Shell(documented("./gravcomp up --virtual --viewer"), folder, dict(os.environ))
    try:
        shell.wait_for("The live page: http://")
        yield shell
    finally:
        if shell.process.poll() is None:
            assert shell.ctrl_c() == 130


@pytest.fixture(scope="module")
def ros2(domain):
    ros2 = Ros2()
    yield ros2
    ros2.close()


SAID_ONCE = (
    "ros2 topic pub --once /target/shape gravcomp_msgs/msg/ShapeTarget '{bend: true, bend_angle: 0.5, tip_position_weight: 1.0}'"
)

# In this order: what one line ends, the next must not need. What each has to say.
ROS2_LINES = {
    "ros2 lifecycle get /can_bridge": "active",
    "ros2 param describe /inverse_controller inverse.tolerance_mm": "inverse.tolerance_mm",
    "ros2 param set /inverse_controller inverse.tolerance_mm 3.0": "successful",
    "ros2 param set /inverse_controller inverse.axial_weight 0.1": "successful",
    "ros2 topic hz /cable/command": "average rate: 9|average rate: 10",
    "ros2 topic echo /controller/status --field message": "target",
    SAID_ONCE: "publishing",
    "ros2 topic pub --once /target/shape gravcomp_msgs/msg/ShapeTarget '{bend: true, bend_angle: 0.5, bend_plane: 1.57, tip_position_weight: 1.0}'": "publishing",
    "ros2 service call /inverse_controller/relax std_srvs/srv/Trigger": "success=True",
    "ros2 service call /inverse_controller/enable std_srvs/srv/SetBool '{data: true}'": "success=True",
    "ros2 lifecycle set /inverse_controller deactivate": "successful",
    "ros2 lifecycle set /inverse_controller activate": "successful",
    "ros2 service call /can_bridge/home std_srvs/srv/Trigger": "success=True",
    "ros2 service call /can_bridge/stop std_srvs/srv/Trigger": "success=True",
}


def test_the_doctor_sees_the_live_graph(live, ros2, type_in):
    end = time.monotonic() + START
    while "target" not in (said := ros2.run("ros2 topic echo /controller/status --field message")):
        assert time.monotonic() < end, said
        time.sleep(0.5)
    code, output = type_in("./gravcomp doctor --graph")
    assert code == 0 and "cable/command" in output, output


def test_the_live_graph_is_recorded_and_judged(live, ros2, type_in, folder):
    from gravcomp.commands.record import describe

    words = [*documented("./gravcomp record --out my_bag --duration 60"), "--duration", "10"]
    recorder = subprocess.Popen(
        words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    time.sleep(5.0)
    ros2.run(SAID_ONCE)
    output, _ = recorder.communicate(timeout=60.0)
    assert recorder.returncode == 0, output
    # What was said there once, by somebody who came and went, is in it as well.
    topics = describe(folder / "my_bag")["topics"]
    assert topics["/target/shape"] == 1 and topics["/imu/data_raw"] > 500
    code, output = type_in("./gravcomp reproduce all --bag my_bag")
    assert code in (0, 1) and "Keeping the shape, recorded" in output and "cables commanded, median" in output, output


def test_an_imu_is_calibrated_from_a_recording(live, type_in, folder):
    code, output = type_in("./gravcomp record --out poses --topics imu/data_raw imu/temperature", "--duration 8")
    assert code == 0, output
    # The robot's base stands still: one pose, which is too few for the scale but enough for the offset of the gyroscope.
    code, output = type_in("./gravcomp calibrate-imu poses --write my_robot.yaml", "--robot article")
    assert code == 0 and "gyroscope" in (folder / "my_robot.yaml").read_text(), output


@pytest.mark.parametrize("line", ROS2_LINES)
def test_a_ros2_line_does_what_it_says(live, ros2, line):
    documented(line)
    assert re.search(ROS2_LINES[line], ros2.run(line))


@pytest.fixture
def apart(monkeypatch):
    """A domain in which nothing else speaks: not that of the live robot either, which goes on."""
    others = {str(number) for number in range(1, 100)} - {os.environ.get("ROS_DOMAIN_ID")}
    monkeypatch.setenv("ROS_DOMAIN_ID", random.SystemRandom().choice(sorted(others)))


@pytest.mark.parametrize("line", ["./gravcomp replay my_bag --speed 2 --viewer", "./gravcomp replay BAG --speed 4 --viewer"])
def test_a_bag_is_replayed(type_in, folder, apart, line):
    if not (folder / "my_bag").exists():
        shutil.copytree(RECORDED, folder / "my_bag")
    code, output = type_in(line, BAG="my_bag")
    assert code == 0 and "played to the end" in output, output


@pytest.mark.parametrize(
    "line",
    [
        "ros2 run gravcomp_estimation imu_estimator",
        "ros2 run gravcomp_estimation imu_estimator --ros-args -p use_sim_time:=true",
        "ros2 run gravcomp_fem fem_simulator",
        "ros2 run gravcomp_fem inverse_controller",
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/soft -p source:=tf -p world_frame:=world -p base_frame:=soft_base -p use:=check",
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/soft -r joint_states:=/joint_states -r robot_description:=/robot_description -p use:=check",
        "ros2 run gravcomp_estimation imu_replay --ros-args -p file:=my_bag",
    ],
)
def test_a_node_runs_until_ctrl_c(folder, apart, monkeypatch, line):
    documented(line)
    if not (folder / "my_bag").exists():
        shutil.copytree(RECORDED, folder / "my_bag")
    monkeypatch.chdir(folder)
    code, output = run_node(line, dict(os.environ), 6.0)
    if "source:=tf" in line and code == 2:
        assert "tf2_msgs" in output  # comes with an installed ROS alone
        return
    assert code == 0 and "Traceback" not in output, output


def test_two_robots_run_side_by_side(folder, apart, type_in):
    lines = ("./gravcomp up --virtual --namespace /left --viewer", "./gravcomp up --virtual --namespace /right --viewer")
    shells = [Shell(documented(line), folder, dict(os.environ)) for line in lines]
    try:
        for shell in shells:
            shell.wait_for("The live page: http://")
        pages = {re.search(r"http://\S+", shell.output.read_text()).group() for shell in shells}
        assert len(pages) == 2
        end = time.monotonic() + START
        while (answer := type_in("./gravcomp doctor --graph --namespace /left"))[0] != 0:
            assert time.monotonic() < end, answer[1]
        assert "cable/command" in answer[1]
    finally:
        codes = [shell.ctrl_c() for shell in shells]
    assert codes == [130, 130]
