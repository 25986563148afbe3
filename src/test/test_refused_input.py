"""Files that cannot be read and places that cannot be written end commands with code 2 and a sentence, before they compute."""

import errno
from pathlib import Path

import pytest
from test_estimate_command import write_trial

from gravcomp.commands import estimate, output, reproduce
from gravcomp.commands.__main__ import main
from gravcomp.commands.parsers import namespace
from gravcomp.description import load_robot_file
from gravcomp.mesh import MeshError

ROBOT_TAKERS = [
    "model build ROBOT",
    "model info ROBOT",
    "model solve ROBOT",
    "model view ROBOT",
    "demo --headless --robot ROBOT",
    "up ROBOT --virtual",
    "arm --robot ROBOT",
    "replay TRIAL --robot ROBOT",
    "estimate TRIAL --robot ROBOT",
    "calibrate --plan --robot ROBOT",
    "calibrate DATA --robot ROBOT",
    "calibrate-imu TRIAL --robot ROBOT",
    "calibrate-mount folder --robot ROBOT",
    "reproduce static --robot ROBOT",
    "firmware model ROBOT",
    "firmware parameters ROBOT",
]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A folder with what is not fit for use; each test begins without the options of another's command."""
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("empty.yaml").write_text("", encoding="utf-8")
    Path("binary.yaml").write_bytes(b"\xff\xfe\x00" * 50)
    Path("DATA").write_text("time,x\n", encoding="utf-8")
    write_trial(Path("TRIAL.npz"))
    yield tmp_path
    output.configure(json=False, quiet=False)


def refused(capsys, line: str, *words: str) -> None:
    """Check that the command line ends with code 2, nothing on stdout and a sentence with these words."""
    assert main(line.replace("TRIAL", "TRIAL.npz").split()) == 2
    printed = capsys.readouterr()
    assert not printed.out and "Traceback" not in printed.err
    for word in words:
        assert word in printed.err, printed.err


@pytest.mark.parametrize("line", ROBOT_TAKERS)
@pytest.mark.parametrize(
    ("robot", "said"),
    [
        ("nobody", "does not exist; give the path of a robot file or the name of a shipped robot: article"),
        ("folder", "is a folder; give the path of a robot file"),
        ("empty.yaml", "is empty or not a mapping; allowed top-level keys: robot"),
        ("binary.yaml", "is not a UTF-8 text file"),
    ],
)
def test_what_is_no_robot_file_is_refused(capsys, line, robot, said):
    refused(capsys, line.replace("ROBOT", robot), robot, said)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("calibrate DATA --out empty.yaml", "--out is empty.yaml: is a file; the path of a folder is needed"),
        ("calibrate DATA --out empty.yaml/pages", "--out is empty.yaml/pages: cannot be created: Not a directory"),
        ("calibrate DATA --material --out empty.yaml", "--out is empty.yaml: is a file"),
        ("calibrate DATA --mapping empty.yaml --out empty.yaml", "--out is empty.yaml: is a file"),
        ("calibrate DATA --write folder", "--write is folder: is a folder; the path of a file is needed"),
        ("calibrate DATA --material --write none/mine.yaml", "cannot be written: there is no folder none"),
        ("calibrate --plan --write folder", "--write is folder: is a folder"),
        ("calibrate --live --write folder", "--write is folder: is a folder"),
        ("calibrate-imu TRIAL --write folder", "--write is folder: is a folder"),
        ("calibrate-imu TRIAL --bias-model folder", "--bias-model is folder: is a folder"),
        ("calibrate-mount folder --write none/mine.yaml", "cannot be written: there is no folder none"),
        ("estimate TRIAL --out folder", "--out is folder: is a folder"),
        ("model view article --out none/robot.png", "cannot be written: there is no folder none"),
        ("model info article --picture folder", "--picture is folder: is a folder"),
        ("firmware build --output empty.yaml", "--output is empty.yaml: is a file"),
        ("firmware model article --output empty.yaml", "--output is empty.yaml: is a file"),
        (
            "firmware send binary.yaml --interface udp_multicast --channel x",
            "binary.yaml is no model for the board; `./gravcomp firmware model",
        ),
        ("reproduce measured none", "none: is no folder; needed is one with tentacle, beam"),
        ("reproduce static --out empty.yaml", "--out is empty.yaml: is a file"),
        ("reproduce static --write binary.yaml", "--write is binary.yaml: is not a UTF-8 text file"),
        ("bench engine --write binary.yaml", "--write is binary.yaml: is not a UTF-8 text file"),
        ("demo --headless --logs empty.yaml", "--logs is empty.yaml: is a file"),
        ("up --virtual --logs empty.yaml", "--logs is empty.yaml: is a file"),
        ("arm --logs empty.yaml", "--logs is empty.yaml: is a file"),
        ("replay TRIAL --logs empty.yaml", "--logs is empty.yaml: is a file"),
        ("replay TRIAL --out empty.yaml/bag", "--out is empty.yaml: is a file"),
        ("record --out empty.yaml/bag", "empty.yaml: is a file"),
        ("bench robots nobody", "nobody: does not exist; give the path of a robot file"),
        ("bench track article folder", "folder: is a folder; give the path of a robot file"),
        ("estimate TRIAL --bias-model folder", "folder: cannot be read: Is a directory"),
        ("estimate TRIAL --bias-model binary.yaml", "binary.yaml: is not a bias model: it is not a UTF-8 text file"),
        ("estimate TRIAL --imu-topic a --topic b", "--topic and its new name --imu-topic are both given"),
        ("estimate TRIAL --imu-topic imu/data", "TRIAL.npz: is no bag, so that it has no topic 'imu/data' to choose"),
    ],
)
def test_a_place_that_cannot_be_used_is_named(capsys, line, said):
    refused(capsys, line, said)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("model info article --directions 3", "--directions is 3; allowed: 4 to 180"),
        ("model info article --target nan 0 90", "tip_position is [nan, 0.0, 0.09]; finite numbers are needed"),
        ("model info article --target 0 0 900", "tip_position is 0.9 m from the base"),
        ("model solve article --target 0 0 900", "tip_position is 0.9 m from the base"),
        ("model solve article --gravity nan 0 0", "--gravity is [nan, 0.0, 0.0]; finite numbers are needed"),
        ("model solve article --gravity -9810 0 0", "--gravity is 9810 m/s^2 long; allowed: up to 100"),
        ("model view article --displacement 1", "--displacement has 1 numbers; one for each cable is needed: s1c1"),
    ],
)
def test_numbers_out_of_range_are_refused_before_the_model_is_built(capsys, monkeypatch, line, said):
    monkeypatch.setattr("gravcomp.simulation.Simulator.__init__", lambda *_, **__: pytest.fail("a model is built"))
    refused(capsys, line, said)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("demo --port 99999999", "--port: is 99999999; allowed: 1 to 65535"),
        ("up --port x", "--port: is 'x'; allowed: 1 to 65535, whole numbers"),
        ("arm --hold nan", "--hold: is nan; allowed: 1 to 600 s"),
        ("arm --travel 0", "--travel: is 0; allowed: 0.5 to 600 s"),
        ("record --duration nan", "--duration: is nan; allowed: 0.1 to 1000000 s"),
        ("calibrate --plan --time 5", "--time: is 5; allowed: 10 to 3600 s"),
        ("bench track --seeds 0", "--seeds: is 0; allowed: 1 to 2147483647"),
        ("bench soak --minutes -1", "--minutes: is -1; allowed: 0.01 to 2147483647"),
        ("firmware test --frames -1", "--frames: is -1; allowed: 1 to 1000000000"),
        *(
            (f"{command} --namespace left", "--namespace: is 'left'; a name that begins with / is needed, e.g. /left")
            for command in ("up", "arm", "record", "replay TRIAL", "calibrate --live", "doctor --graph")
        ),
    ],
)
def test_values_of_options_are_checked_when_they_are_read(capsys, line, said):
    with pytest.raises(SystemExit) as end:
        main(line.split())
    printed = capsys.readouterr()
    assert end.value.code == 2 and not printed.out and f"argument {said}" in printed.err


def test_the_global_namespace_and_a_slash_at_the_end_are_allowed():
    assert [namespace(text) for text in ("", "/", "/left", "/left/", "/a/b")] == ["", "", "/left", "/left", "/a/b"]


def test_a_board_of_a_real_robot_gets_no_motors_that_nobody_described(capsys, tmp_path):
    text = Path(load_robot_file("catheter").source).read_text(encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(text.split("\nhardware:")[0], encoding="utf-8")
    refused(
        capsys, f"firmware parameters {path} --interface socketcan --channel can9", f"{path}: key 'hardware.motors' is missing"
    )


def test_a_body_that_cannot_be_meshed_is_named_with_its_file(capsys, monkeypatch, tmp_path):
    def run(_):
        raise MeshError("elements are flat")

    path = tmp_path / "mine.yaml"
    path.write_text("robot: {}", encoding="utf-8")
    monkeypatch.setattr(reproduce, "run", run)
    refused(capsys, f"reproduce static --robot {path}", f"gravcomp reproduce: {path}: robot: elements are flat")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.EROFS, "Read-only file system", "/there/x.npz"), "gravcomp estimate: /there/x.npz: Read-only file system"),
        (OSError(errno.ENOSPC, "No space left on device"), "gravcomp estimate: No space left on device"),
    ],
)
def test_a_disk_that_refuses_ends_a_command_with_a_sentence(capsys, monkeypatch, error, said):
    def run(_):
        raise error

    monkeypatch.setattr(estimate, "run", run)
    refused(capsys, "estimate TRIAL", said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["up", "--interface", "socketcan", "--channel", "nocan7"], "socketcan nocan7 cannot be opened"),
        (["up", "--tracker", "5"], "--tracker needs --virtual"),
        (["arm", "--xacro", "ARM"], "has no link 'soft_base'; it has: world"),
        (["demo", "--duration", "1"], "--duration"),
    ],
    ids=" ".join,
)
def test_what_can_be_refused_at_once_starts_no_process(words, said, tmp_path, monkeypatch, capsys):
    def start() -> None:
        raise AssertionError("the nodes' host is started for nothing")

    arm = tmp_path / "arm.urdf.xacro"
    arm.write_text('<robot name="arm"><link name="world"/></robot>', encoding="utf-8")
    monkeypatch.setattr("gravcomp.launcher.host_client.NodeHost", start)
    assert main([str(arm) if word == "ARM" else word for word in words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
