"""`./gravcomp COMMAND ...` before anything is installed: overview, version, unknown commands; else enter the environment.

Only the standard library is imported here.
"""

import sys
from pathlib import Path

from gravcomp.commands import COMMANDS, overview
from gravcomp.commands.version import version_text


def start(root: Path, arguments: "list[str]") -> int:
    """Run the command in the repository `root`. Returns the exit code, unless the command replaces this process."""
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(overview())
        return 0
    if arguments[0] in ("-V", "--version"):
        print(version_text(root))
        return 0
    if arguments[0] not in COMMANDS:
        print(f"gravcomp: unknown command '{arguments[0]}'\n\n{overview()}", file=sys.stderr)
        return 2
    if arguments[0] == "completion" and sys.version_info >= (3, 11):
        # Needs the standard library only; a shell waits for it at its start.
        from gravcomp.commands.__main__ import main

        return main(arguments)
    from gravcomp.environment.ready import enter

    return enter(root, arguments)
