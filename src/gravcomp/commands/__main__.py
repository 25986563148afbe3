"""`python -m gravcomp.commands COMMAND ...`: what `./gravcomp` runs inside the environment."""

import argparse
import importlib
import sys

from gravcomp.commands import COMMANDS, overview
from gravcomp.environment.interrupt import run_interruptible


def main(arguments: list[str]) -> int:
    """Run one command; returns the exit code, 2 for a mistake in what was given."""
    if not arguments or arguments[0] not in COMMANDS:
        print(overview(), file=sys.stderr)
        return 2
    name, *rest = arguments
    module = importlib.import_module(f"gravcomp.commands.{name.replace('-', '_')}")
    parser = argparse.ArgumentParser(prog=f"gravcomp {name}", description=COMMANDS[name], allow_abbrev=False)
    module.add_arguments(parser)
    if own := getattr(module, "OWN", ()):
        # argparse would take options that it does not know for mistakes.
        count = next((i for i, word in enumerate(rest) if word not in own), len(rest))
        rest.insert(count, "--")
    from gravcomp.config import ConfigError
    from gravcomp.launcher import LaunchError, NodeDied

    try:
        return module.run(parser.parse_args(rest))
    except (ConfigError, LaunchError, NodeDied, TimeoutError) as error:
        print(f"gravcomp {name}: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    run_interruptible(lambda: main(sys.argv[1:]))
