"""What all commands have in common: --help, --json, --quiet, exit codes, version, completion."""

import argparse
import io
import json
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from test_estimate_command import write_trial

from gravcomp import __version__
from gravcomp.commands import COMMANDS, output
from gravcomp.commands.__main__ import main
from gravcomp.commands.completion import script
from gravcomp.commands.parsers import EXIT_CODES, parser_of
from gravcomp.commands.version import version_text

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def own_options():
    """Each test begins without the options of another's command."""
    output.configure(json=False, quiet=False)
    yield
    output.configure(json=False, quiet=False)


PACKAGES = ("src", "gravcomp_msgs", "gravcomp_node", "gravcomp_hw", "gravcomp_estimation", "gravcomp_fem")


def subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    choices = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return choices[0] if choices else {}


WITH_SUBCOMMANDS = [[name, *rest] for name in COMMANDS for rest in ([], *([sub] for sub in subparsers(parser_of(name))))]


@pytest.mark.parametrize("words", WITH_SUBCOMMANDS, ids=" ".join)
def test_help_names_the_common_options_and_the_exit_codes(words, capsys):
    with pytest.raises(SystemExit) as end:
        main([*words, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert end.value.code == 0
    assert f"gravcomp {' '.join(words)}" in text and "--json" in text and "--quiet" in text
    for code, meaning in EXIT_CODES.items():
        assert f"{code} {meaning}" in text


@pytest.mark.parametrize(
    "words",
    [
        ["estimate", "TRIAL"],
        ["model", "solve", "--full"],
        ["model", "--json", "solve", "--full"],
        ["model", "view", "--full", "--out", "robot.png"],
        ["doctor"],
        ["completion", "zsh"],
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("quiet", [False, True])
def test_json_is_the_only_line_on_stdout(words, quiet, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = [str(write_trial(tmp_path / "trial.npz")) if word == "TRIAL" else word for word in words]
    assert main([*words, *(["--json"] if "--json" not in words else []), *(["--quiet"] if quiet else [])]) in (0, 1)
    printed = capsys.readouterr()
    assert printed.out.count("\n") == 1 and isinstance(json.loads(printed.out), dict)
    assert not (quiet and printed.err)


def test_without_json_the_result_is_for_reading(tmp_path, capsys):
    assert main(["estimate", str(write_trial(tmp_path / "trial.npz")), "--quiet"]) == 0
    printed = capsys.readouterr()
    assert "gyroscope bias" in printed.out and not printed.err


def test_what_the_terminal_cannot_show_is_replaced(monkeypatch):
    """A robot with an umlaut in its name, in a terminal for ASCII."""
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    output.configure(json=False, quiet=False)
    output.result({}, "gr\u00f6\u00dfe: 3 mm")
    sys.stdout.flush()
    assert shown.getvalue() == b"gr??e: 3 mm\n"


def test_without_a_terminal_nobody_draws_progress(capsys):
    """A thread would make the picture ten times a second, for nobody."""
    before = threading.active_count()
    with output.stages("first") as show, output.display() as bar, output.busy("computing") as say:
        show("second")
        say("more")
        bar.update(bar.add_task("training"), completed=1.0)
        assert threading.active_count() == before
    assert capsys.readouterr().err == ""


def test_quiet_keeps_errors(capsys):
    assert main(["estimate", "nowhere.npz", "--quiet", "--json"]) == 2
    printed = capsys.readouterr()
    assert not printed.out and "nowhere.npz" in printed.err


def test_parsers_are_made_without_heavy_imports():
    """They make the help and the completion, which should come immediately."""
    program = "import sys; from gravcomp.commands.completion import script; script('bash'); print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT / "src", check=True)
    assert not {"numpy", "scipy", "numba", "matplotlib", "rich", "yaml"} & set(done.stdout.split())


def complete(shell_script: str, *words: str) -> list[str]:
    """What bash offers for the last of the words."""
    call = 'COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _gravcomp; printf "%s\\n" "${COMPREPLY[@]}"'
    done = subprocess.run(["bash", "-c", f"{shell_script}\n{call}", "bash", *words], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("calibrate",), {"calibrate", "calibrate-imu", "calibrate-mount"}),
        (("model", ""), {"build", "info", "solve", "view"}),
        (("model", "solve", "--dis"), {"--displacement"}),
        (("model", "info", "long"), {"long_segment"}),
        (("demo", "--robot", "three"), {"three_segment"}),
        (("arm", "--gravity", ""), {"imu", "arm", "both", "fused"}),
        (("reproduce", "imu"), {"imu-ablation"}),
        (("completion", "z"), {"zsh"}),
    ],
)
def test_bash_completes_commands_options_and_robots(words, offered, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert set(complete(script("bash"), "./gravcomp", *words)) == offered


def test_the_script_prints_the_completion():
    done = subprocess.run([ROOT / "gravcomp", "completion", "bash"], capture_output=True, text=True, check=True)
    assert done.stdout == script("bash") and not done.stderr


def test_bash_completes_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_robot.yaml").touch()
    assert complete(script("bash"), "./gravcomp", "up", "my") == ["my_robot.yaml"]


def test_the_version_is_printed_with_the_commit():
    done = subprocess.run([ROOT / "gravcomp", "--version"], capture_output=True, text=True, check=True)
    commit = r" \([0-9a-f]{7,}\)" if (ROOT / ".git").exists() else ""
    assert re.fullmatch(rf"gravcomp {re.escape(__version__)}{commit}\n", done.stdout)


def test_the_version_needs_no_repository(tmp_path):
    assert version_text(tmp_path) == f"gravcomp {__version__}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_has_the_same_version(package):
    folder = ROOT / package
    manifest = (folder / "package.xml").read_text(encoding="utf-8")
    assert f"<version>{__version__}</version>" in manifest
    if (folder / "setup.py").exists():
        assert f'version="{__version__}"' in (folder / "setup.py").read_text(encoding="utf-8")


def test_citation_and_changelog_name_the_version():
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert "## [Unreleased]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_what_is_compiled_is_said_and_what_fails_is_named(monkeypatch, capsys):
    """Without a terminal, where no status is shown."""
    from gravcomp.commands.preparation import compile_parts
    from gravcomp.launcher import compilation

    failing = [sys.executable, "-I", "-S", "-c", "raise SystemExit('no room on the disk')"]
    monkeypatch.setattr(compilation, "missing", list)
    monkeypatch.setattr(compilation, "start", lambda parts: [subprocess.Popen(failing, stderr=subprocess.PIPE, text=True)])
    compile_parts(("contact",))
    said = capsys.readouterr().err
    assert "compiling, once for this machine (a minute or two): contact" in said
    assert "compiling the contact failed (no room on the disk)" in said
