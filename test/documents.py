"""Command lines of the documents, for the tests that check and run them."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("gravcomp_hw", "gravcomp_estimation", "gravcomp_fem", "gravcomp_node", "gravcomp_msgs")
FOLDERS = ("src", *PACKAGES)
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))])
NAMES = [str(path.relative_to(ROOT)) for path in DOCUMENTS]


def blocks_of(text: str) -> list[str]:
    """Return the lines of code blocks, without comments."""
    lines = re.findall(r"^ {4,7}(\S.*)$", text, re.MULTILINE)
    lines += [line for block in re.findall(r"```(?:bash|sh)?\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    return [re.sub(r"\s+# .*", "", line).strip() for line in lines]


def inline_of(text: str) -> list[str]:
    """Return what stands between single backticks."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def code_of(path: Path) -> list[str]:
    """Return the code lines, without comments, and the inline code of a document."""
    text = path.read_text(encoding="utf-8")
    return blocks_of(text) + inline_of(text)


def commands_of(path: Path) -> list[list[str]]:
    """Return the words of every `./gravcomp ...` line; a line with alternatives a|b gives one entry for each."""
    found = []
    for line in code_of(path):
        if not line.startswith("./gravcomp "):
            continue
        words = shlex.split(line.replace("\\|", "|"))[1:]
        choices = next((w for w in words if re.fullmatch(r"\w+(\|\w+)+", w)), None)
        found += [[c if w == choices else w for w in words] for c in choices.split("|")] if choices else [words]
    return found


COMMAND_LINES = sorted({tuple(words) for path in DOCUMENTS for words in commands_of(path)})
"""The words after ./gravcomp of every command line, including those in the running text."""

TYPED = sorted(
    {line for path in DOCUMENTS for line in blocks_of(path.read_text(encoding="utf-8")) if re.match(r"(\./gravcomp|ros2) ", line)}
)
"""Lines in blocks of code, which the reader types."""


def documented(line: str, **given: object) -> list[str]:
    """Return the words of a line that a document contains; fails when no document contains it.

    given: values of the placeholders by their names without suffix (FILE, ROBOT for ROBOT.yaml).
    """
    assert line in TYPED, f"no document says '{line}'"
    values = {name: str(value) for name, value in given.items()}
    return [values.get(word.partition(".")[0], word) for word in shlex.split(line)]
