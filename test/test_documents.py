"""The documents name only what exists: commands with their options, links, topics, services, parameters, modules."""

import argparse
import ast
import importlib
import importlib.util
import pkgutil
import re
import shlex

import pytest
from documents import COMMAND_LINES, NAMES, PACKAGES, ROOT, code_of, inline_of

from gravcomp.commands import COMMANDS
from gravcomp.commands.parsers import parse, parser_of
from gravcomp.config import declared_parameters, load_yaml
from gravcomp.description import shipped_robots
from gravcomp.description.hardware import Hardware
from gravcomp.graph.nodes import NODES, node
from gravcomp.launcher.robot_graph import COMPOSED, LOOP
from gravcomp.virtual.parameters import VirtualRobotParameters

# Values for the placeholders of the documents.
PLACEHOLDERS = {"COMMAND": "demo", "S": "10", "N": "1"}
SUBCOMMANDS = {"bench": "engine", "reproduce": "static"}  # for NAME
FOREIGN_PACKAGES = {"robot_state_publisher", "foxglove_bridge", "plotjuggler"}


class StrictParser(argparse.ArgumentParser):
    """A parser that raises ValueError and refuses abbreviated options, in its subparsers as well."""

    def __init__(self, **options):
        super().__init__(**{**options, "allow_abbrev": False})

    def error(self, message):
        raise ValueError(message)


def filled(words: list[str]) -> list[str]:
    """Return the words with values in place of the placeholders."""
    words = [PLACEHOLDERS.get(word, word) for word in words]
    return [SUBCOMMANDS.get(words[0], word) if word == "NAME" else word for word in words]


def test_there_are_commands_to_check():
    assert {words[0] for words in COMMAND_LINES} >= set(COMMANDS)


@pytest.mark.parametrize("words", COMMAND_LINES, ids=" ".join)
def test_a_command_line_names_what_exists(words):
    command, *rest = filled(list(words))
    assert command in COMMANDS or [command, *rest] == ["--version"]
    if rest and rest != ["--help"]:  # a command alone is only mentioned
        parse(parser_of(command, StrictParser), rest)
    for word in rest:
        if re.match(r"src/|test/", word):
            assert (ROOT / word).exists(), f"{word} does not exist"


@pytest.mark.parametrize("words", [("demo",), ("bench", "engine")], ids=" ".join)
def test_help_is_given(gravcomp, words):
    """As a process; `src/test/test_commands.py` reads the help of every command."""
    answer = gravcomp(*words, "--help")
    assert answer.code == 0 and f"gravcomp {' '.join(words)}" in answer.out


@pytest.mark.parametrize("name", NAMES)
def test_a_link_leads_somewhere(name):
    path = ROOT / name
    for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
        if re.match(r"https?:|mailto:", target):
            continue
        file, _, anchor = target.partition("#")
        place = (path.parent / file).resolve() if file else path
        assert place.exists(), f"{target} does not exist"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", place.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = [re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings]
            assert anchor in slugs, f"{target}: no such heading"


def parameters_of(executable: str) -> set[str]:
    """Return the names of a node's ROS parameters."""
    return {leaf.key for leaf in node(executable).declared_parameters()}


def ports(*kinds: str) -> dict[str, str]:
    return {port.name: port.type for entry in NODES for kind in kinds for port in getattr(entry, kind)}


def executables_of(package: str) -> list[str]:
    """Return the executables of a package, by which `ros2 run` finds them."""
    return re.findall(r"^\s+\"(\w+) = ", (ROOT / package / "setup.py").read_text(encoding="utf-8"), re.MULTILINE)


EXECUTABLES = {name: package for package in PACKAGES[:3] for name in executables_of(package)}
NODE_PARAMETERS = {key for entry in NODES for key in parameters_of(entry.executable)}


def check_ros2(words: list[str]) -> None:
    """Check that a `ros2 ...` line fits the interface of the graph."""
    match words[1:]:
        case ["run" | "launch", package, *_] if package in FOREIGN_PACKAGES:
            for word in words:
                if word.startswith(PACKAGES):
                    assert (ROOT / word).exists(), f"{word} does not exist"
        case ["launch", package, file, *rest]:
            text = (ROOT / package / "launch" / file).read_text(encoding="utf-8")
            for word in rest:
                assert re.search(rf"""["{{]\W*(name: )?{word.partition(":=")[0]}\b""", text), f"{file} has no argument {word}"
        case ["run", package, executable, *rest]:
            assert EXECUTABLES.get(executable) == package
            inner = [name for _, name in LOOP[1:]] if (package, executable) == COMPOSED else [executable]
            entries = [node(name) for name in inner]
            names = {port.name for entry in entries for port in (*entry.subscribes, *entry.publishes)} | {"__ns", "__node"}
            known = set().union(*(parameters_of(name) for name in inner)) | {"use_sim_time"}
            known |= {f"{name}:{key}" for name in inner for key in parameters_of(name)}
            for option, word in zip(rest, rest[1:]):
                key = word.partition(":=")[0]
                if option == "-p":
                    assert key in known, f"{executable} has no parameter {key}"
                if option == "-r":
                    assert key in names, f"{executable} has no topic {key}"
        case ["service", "call", name, kind, *_]:
            _, executable, service = name.split("/")
            assert (f"~/{service}", kind) in [(port.name, port.type) for port in node(executable).services]
        case ["topic", "pub", *rest]:
            name, kind, *content = [word for word in rest if not word.startswith("-")]
            assert ports("subscribes").get(name.lstrip("/")) == kind
            if content and kind.startswith("gravcomp_msgs/"):
                fields = re.findall(r"^\S+ (\w+)", (ROOT / f"{kind}.msg").read_text(encoding="utf-8"), re.MULTILINE)
                assert set(re.findall(r"(\w+):", content[0])) <= set(fields)
        case ["param", "set" | "get" | "describe", name, key, *_]:
            assert key in parameters_of(name.lstrip("/"))
        case ["lifecycle", "get", name]:
            assert parameters_of(name.lstrip("/"))
        case ["lifecycle", "set", name, transition]:
            assert parameters_of(name.lstrip("/")) and transition in (
                "configure",
                "activate",
                "deactivate",
                "cleanup",
                "shutdown",
            )
        case ["topic", "hz", name]:
            assert name.lstrip("/") in ports("publishes")
        case ["topic", "echo", name, "--field", field]:
            kind = ports("publishes")[name.lstrip("/")]
            assert field in re.findall(r"^\S+ (\w+)", (ROOT / f"{kind}.msg").read_text(encoding="utf-8"), re.MULTILINE)
        case _:
            raise AssertionError(f"no check is known for {' '.join(words)}")


@pytest.mark.parametrize("name", NAMES)
def test_ros2_lines_fit_the_graph(name):
    for line in code_of(ROOT / name):
        if line.startswith("ros2 ") and len(line.split()) > 3:
            check_ros2(shlex.split(line))


@pytest.mark.parametrize("name", NAMES)
def test_topics_and_services_exist(name):
    topics = set(ports("publishes", "subscribes"))
    services = set(ports("services"))
    for word in inline_of((ROOT / name).read_text(encoding="utf-8")):
        if re.fullmatch(r"(imu|cable|robot|controller|target|truth|virtual|measured)/[a-z_]+", word):
            assert word in topics, f"no topic {word}"
        if word.startswith("~/") and "." not in word:
            assert word in services, f"no service {word}"


# The changelog names old keys and modules as well.
CURRENT = [name for name in NAMES if name != "CHANGELOG.md"]


@pytest.mark.parametrize("name", CURRENT)
def test_parameters_and_keys_exist(name):
    article = load_yaml(shipped_robots()["article"])
    sections = (("hardware", Hardware), ("virtual_robot", VirtualRobotParameters))
    declared = {f"{section}.{leaf.key}" for section, kind in sections for leaf in declared_parameters(kind)}
    for word in inline_of((ROOT / name).read_text(encoding="utf-8")):
        if re.fullmatch(r"(inverse|prediction|calibration|filter|heater|lumen)\.[a-z_.]+", word):
            assert word in NODE_PARAMETERS, f"no parameter {word}"
        if re.fullmatch(r"(robot|hardware|virtual_robot)\.[a-z_.]+", word) and word not in declared:
            section = article
            for key in word.split("."):
                assert isinstance(section, dict) and key in section, f"no key {word}"
                section = section[key]


@pytest.mark.parametrize("name", CURRENT)
def test_modules_exist(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    words = {w for w in inline_of(text) if re.fullmatch(r"gravcomp(\.\w+)+", w) and not (ROOT / name).with_name(w).exists()}
    for word in words:
        assert exists(word), f"no module {word}"
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        for statement in ast.walk(ast.parse(block)):
            if isinstance(statement, ast.ImportFrom):
                module = importlib.import_module(statement.module)
                assert all(hasattr(module, alias.name) for alias in statement.names)


def exists(dotted: str) -> bool:
    """Return whether `dotted` is a module, a name in a module, or an attribute or field of such a name."""
    try:
        if importlib.util.find_spec(dotted):
            return True
    except ModuleNotFoundError:
        pass
    owner, _, name = dotted.rpartition(".")
    try:
        found = pkgutil.resolve_name(owner)
    except (ImportError, AttributeError):
        return False
    return hasattr(found, name) or name in getattr(found, "__dataclass_fields__", ())  # a field without default


def keys_of(section: object) -> set[str]:
    """Return all keys of a YAML file, at any depth."""
    if isinstance(section, dict):
        return set(section) | {key for value in section.values() for key in keys_of(value)}
    return {key for value in section for key in keys_of(value)} if isinstance(section, list) else set()


GLOSSARY = "src/doc/glossary.md"
# Frames and words of ROS, and the name of the shipped robot.
OTHER_NAMES = {"soft_base", "soft_tip", "soft_rest", "imu_link", "__ns", "stamp", "article"}
# Keys with a default that no shipped robot file gives.
DEFAULT_KEYS = {"via_points_mm", "creep_ratio", "creep_time", "prony", "fibres", "c01_ratio", "c20_ratio", "c30_ratio"}


def glossary_names() -> list[str]:
    """Return the names in the third column of the glossary's tables."""
    rows = [line for line in (ROOT / GLOSSARY).read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    return sorted({word for row in rows for word in re.findall(r"`([^`]+)`", row.split(" | ")[2])})


@pytest.mark.parametrize("name", glossary_names())
def test_a_name_of_the_glossary_exists(name):
    if name.startswith("gravcomp."):
        assert exists(name), f"no module or name {name}"
    elif re.match(r"[A-Z]\w+\.", name):
        message, field = name.split(".")
        assert re.search(
            rf"^\S+ {field}\b", (ROOT / f"gravcomp_msgs/msg/{message}.msg").read_text(encoding="utf-8"), re.MULTILINE
        )
    elif name.startswith(("robot.", "hardware.")):
        pass  # test_parameters_and_keys_exist
    else:
        keys = {key for path in shipped_robots().values() for key in keys_of(load_yaml(path))} | DEFAULT_KEYS
        topics = {topic.lstrip("/") for topic in ports("publishes", "subscribes", "services")}
        assert name in keys | topics | NODE_PARAMETERS | set(EXECUTABLES) | OTHER_NAMES


def tree_of_the_core() -> list[list[str]]:
    """Return the packages and modules of the core, one list for each line of src/README.md; without robots/, which holds data."""
    rows = re.findall(r"^\| (`\S.*?) \|", (ROOT / "src/README.md").read_text(encoding="utf-8"), re.MULTILINE)
    lines = [[name.strip("`/").removesuffix(".py") for name in row.split(", ")] for row in rows]
    return [[name for name in line if name != "robots"] for line in lines]


def test_the_tree_of_the_core_is_whole():
    folder = ROOT / "src/gravcomp"
    packages = {path.parent.name for path in folder.glob("*/__init__.py")}
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert {name for line in tree_of_the_core() for name in line} == packages | modules


def test_no_import_goes_up():
    allowed: set[str] = set()
    for line in reversed(tree_of_the_core()):
        allowed |= set(line) | {"__version__"}
        for name in line:
            folder = ROOT / "src/gravcomp" / name
            for path in sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]:
                imported = re.findall(
                    r"^\s*(?:from|import) gravcomp(?:\.| import )(\w+)", path.read_text(encoding="utf-8"), re.MULTILINE
                )
                assert set(imported) <= allowed, f"{path.relative_to(ROOT)} imports {sorted(set(imported) - allowed)}"
