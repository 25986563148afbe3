"""No text of the repository uses the words that were replaced by the terms of the field (src/doc/glossary.md)."""

import functools
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# By what to write instead.
AVOIDED = {
    "report, print, state, show": ["is told", "are told", "was told", "were told", "tells people", "for people", "told first"],
    "current figures": ["figures of now", "the figure of now"],
    "remaining error, residual": ["what is left of it", "is short by", "short by", "falls short of what"],
    "tracking error": ["how well the target is kept"],
    "state or health of the IMU": ["is thought of", "what is thought", "thinks of its"],
    "recovery": ["ways out", "way out", "way back", "leads back", "lead back", "leading back"],
    "must, must not": ["shall"],
    "again": ["anew"],
    "next to, in addition to": ["beside", "besides"],
    "the caller, the user": ["whoever", "who starts it", "who pushes", "who writes firmware"],
    "your own robot": ["one's own", "a robot of one", "robots of one"],
    "data lost when the process is killed": ["a kill may lose", "what a kill"],
    "has no equilibrium, fails": ["gives way", "give way"],
    "the controller's model": ["believes in", "believed", "believes"],
    "evaluate": ["judges", "judged", "judging"],
    "handle, ignore": ["heed", "heeds", "heeded", "deaf to"],
    "repair": ["mend", "mends", "mended"],
    "sag": ["is hung up", "hung up"],
    "at rest": ["stands still", "stand still", "standing still"],
    "immediately": ["starts at once", "begin at once"],
    "occasionally": ["now and then"],
    "reached ... of the load": ["of the load was carried", "cannot carry the rest"],
    "asked for (target)": ["what was asked for", "the shape asked for"],
    "the run, the scenario": ["the play", "into the play"],
    "compensate, correct": ["makes good", "make good", "made good", "make up for", "makes up for"],
}

EXCLUDED = {"CHANGELOG.md", "src/test/test_vocabulary.py"}
SUFFIXES = {".py", ".md", ".yaml", ".yml", ".toml", ".cff", ".msg", ".xml", ".xacro", ".cfg", ".txt", ".in", ""}


def files() -> list[Path]:
    """Tracked text files, or in an unpacked archive all files outside of hidden and built folders."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode == 0 and listed.stdout:
        names = listed.stdout.splitlines()
    else:
        built = {"build", "install", "log", "reports", "__pycache__"}
        paths = (path.relative_to(ROOT) for path in ROOT.rglob("*"))
        names = [str(p) for p in paths if not built & set(p.parts) and not any(part.startswith(".") for part in p.parts)]
    paths = (
        ROOT / name
        for name in names
        if name not in EXCLUDED and not name.endswith("LICENSE") and not name.startswith("test/data/")
    )
    return sorted(path for path in paths if path.suffix in SUFFIXES and path.is_file() and not path.is_symlink())


@functools.cache
def texts() -> dict[Path, tuple[str, str]]:
    """The text of each file, and the same as `plain` gives it."""
    found = {}
    for path in files():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found[path] = text, plain(text)
    return found


def plain(text: str) -> str:
    """The text without case, each run of what may stand between two words as one space: where `pattern` matches, a phrase is."""
    return re.sub(r"[\s#\"]+", " ", text.casefold())


def pattern(phrases: list[str]) -> re.Pattern:
    """The phrases as whole words in any case; a space may be a line break, also within a docstring or comment."""
    alternatives = "|".join(re.escape(phrase).replace(r"\ ", r"[\s#\"]+") for phrase in phrases)
    return re.compile(rf"(?<![\w-])(?:{alternatives})(?![\w-])", re.IGNORECASE)


@pytest.mark.parametrize("instead", AVOIDED)
def test_no_text_uses_a_replaced_word(instead):
    phrases = AVOIDED[instead]
    expression, within = pattern(phrases), [plain(phrase) for phrase in phrases]
    found = []
    for path, (text, simple) in texts().items():
        if any(phrase in simple for phrase in within):  # the search for whole words in all texts takes a hundred times as long
            found += [
                f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, m.start()) + 1}: '{' '.join(m[0].split())}'"
                for m in expression.finditer(text)
            ]
    assert not found, f"write '{instead}':\n" + "\n".join(found)
