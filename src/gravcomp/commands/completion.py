"""`gravcomp completion SHELL`: print the completion script for bash or zsh, made from the parsers of all commands.

The script contains every word that it can complete, so that completing does not start Python.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gravcomp.commands import COMMANDS, output
from gravcomp.commands.parsers import parser_of

_ROBOTS = Path(__file__).parents[1] / "robots"
_ROBOT_ARGUMENTS = ("--robot", "robot")  # take the name of a shipped robot or a path

# zsh runs the same script after `bashcompinit`. path: the command, with its subcommand where there is one.
_SCRIPT = """\
# Completion of ./gravcomp, written by `./gravcomp completion`.
{head}_gravcomp() {{
    local current="${{COMP_WORDS[COMP_CWORD]}}" previous="${{COMP_WORDS[COMP_CWORD-1]}}" path="${{COMP_WORDS[1]}}"
    local options="" words="" files=1
    COMPREPLY=()
    if [[ $COMP_CWORD -eq 1 ]]; then
        COMPREPLY=($(compgen -W "{commands}" -- "$current"))
        return
    fi
    case "$path" in
    {nested}) [[ $COMP_CWORD -gt 2 ]] && path="$path ${{COMP_WORDS[2]}}";;
    esac
    case "$path" in
{words}
    esac
    case "$path $previous" in
{values}
    esac
    if [[ $current == -* ]]; then
        COMPREPLY=($(compgen -W "$options" -- "$current"))
    else
        COMPREPLY=($(compgen -W "$words" -- "$current"))
        [[ $files -eq 1 ]] && COMPREPLY+=($(compgen -f -- "$current"))
    fi
}}
complete -o filenames -F _gravcomp gravcomp ./gravcomp
"""


@dataclass
class _Words:
    """Words that can follow one command or subcommand."""

    options: list[str] = field(default_factory=list)
    positional: list[str] = field(default_factory=list)
    values: dict[str, tuple[list[str], bool]] = field(default_factory=dict)  # choices by option, and whether it takes paths
    files: bool = True  # paths can follow as well


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Print a completion script. In bash: `source <(./gravcomp completion bash)`, in ~/.bashrc for every session. In zsh:"
        " the same with zsh, after `compinit`."
    )
    parser.add_argument("shell", choices=("bash", "zsh"), metavar="SHELL", help="bash or zsh")


def run(args: argparse.Namespace) -> int:
    """Print the script. Returns 0."""
    text = script(args.shell)
    if args.json:
        output.result({"shell": args.shell, "script": text}, "")
    else:
        print(text, end="")
    return 0


def script(shell: str) -> str:
    """Return the completion script for `shell`, bash or zsh."""
    found = dict(_words())
    return _SCRIPT.format(
        head="autoload -U +X bashcompinit && bashcompinit\n" if shell == "zsh" else "",
        commands=" ".join([*COMMANDS, "--help", "--version"]),
        nested="|".join(sorted({path.split()[0] for path in found if " " in path})),
        words="\n".join(
            f'    "{path}") options="{" ".join(w.options)}" words="{" ".join(w.positional)}" files={w.files:d};;'
            for path, w in found.items()
        ),
        values="\n".join(
            f'    "{path} {option}") words="{" ".join(values)}" files={files:d};;'
            for path, w in found.items()
            for option, (values, files) in w.values.items()
        ),
    )


def _words() -> Iterator[tuple[str, _Words]]:
    """Yield the words of each command ('model') and of each subcommand ('model solve')."""
    for command in COMMANDS:
        yield from _words_of(command, parser_of(command))


def _words_of(path: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, _Words]]:
    found = _Words()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found.positional, found.files = list(action.choices), False
            for name, own in action.choices.items():
                yield from _words_of(f"{path} {name}", own)
            continue
        choices, files = [str(choice) for choice in action.choices or ()], False
        if (action.option_strings or [action.dest])[0] in _ROBOT_ARGUMENTS:
            choices, files = sorted(file.stem for file in _ROBOTS.glob("*.yaml")), True
        if not action.option_strings:
            found.positional += choices
            continue
        found.options += action.option_strings
        if choices:
            found.values.update(dict.fromkeys(action.option_strings, (choices, files)))
    yield path, found
