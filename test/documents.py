"""The command lines that stand in the documents, for the tests that check and run them."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("gravcomp_hw", "gravcomp_estimation", "gravcomp_fem", "gravcomp_node", "gravcomp_msgs")
FOLDERS = ("src", *PACKAGES)
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))])
NAMES = [str(path.relative_to(ROOT)) for path in DOCUMENTS]


def blocks_of(text: str) -> list[str]:
    """Lines of code blocks, without comments."""
    lines = re.findall(r"^ {4,7}(\S.*)$", text, re.MULTILINE)
    lines += [line for block in re.findall(r"```(?:bash|sh)?\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    return [re.sub(r"\s+# .*", "", line).strip() for line in lines]


def inline_of(text: str) -> list[str]:
    """What stands between single backticks."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def code_of(path: Path) -> list[str]:
    """Code lines, without comments, and inline code of a document."""
    text = path.read_text()
    return blocks_of(text) + inline_of(text)


def commands_of(path: Path) -> list[list[str]]:
    """Every `./gravcomp ...` line with words, one for each alternative a|b."""
    found = []
    for line in code_of(path):
        if not line.startswith("./gravcomp "):
            continue
        words = shlex.split(line.replace("\\|", "|"))[1:]
        choices = next((w for w in words if re.fullmatch(r"\w+(\|\w+)+", w)), None)
        found += [[c if w == choices else w for w in words] for c in choices.split("|")] if choices else [words]
    return found


COMMAND_LINES = sorted({tuple(words) for path in DOCUMENTS for words in commands_of(path)})
"""The words after ./gravcomp of every command line, mentions in the text included."""

TYPED = sorted({line for path in DOCUMENTS for line in blocks_of(path.read_text()) if re.match(r"(\./gravcomp|ros2) ", line)})
"""Lines that stand in blocks of code, for the reader to type."""


def documented(line: str, **given: object) -> list[str]:
    """The words of a line that the documents tell the reader to type, with values for what he puts in himself (FILE, ROBOT.yaml: by its
    first word). A test that runs it this way is held to the documents, and they to it."""
    assert line in TYPED, f"no document says '{line}'"
    values = {name: str(value) for name, value in given.items()}
    return [values.get(word.partition(".")[0], word) for word in shlex.split(line)]
