"""The option --imu-topic of the commands that read a bag, and its earlier name."""

import argparse

from gravcomp.commands import output

_NAME, _EARLIER, _ACCEPTED_UNTIL = "--imu-topic", "--topic", "0.3"


def add_imu_topic(parser: argparse.ArgumentParser) -> None:
    """Declare the option; its earlier name is not shown in the help."""
    parser.add_argument(_NAME, metavar="TOPIC", help="IMU topic, when the bag has several")
    parser.add_argument(_EARLIER, dest="earlier_imu_topic", metavar="TOPIC", help=argparse.SUPPRESS)


def imu_topic(args: argparse.Namespace) -> str | None:
    """Return the topic that is asked for, None for none.

    Raises ConfigError for both names, and for the earlier one after its last release.
    """
    from gravcomp.config import ConfigError
    from gravcomp.config.declaration import Parameter

    earlier: str | None = args.earlier_imu_topic
    if earlier is None:
        return args.imu_topic or None
    if args.imu_topic is not None:
        raise ConfigError(f"{_EARLIER} and its new name {_NAME} are both given")
    if not Parameter("", renamed_from=_EARLIER, accepted_until=_ACCEPTED_UNTIL).accepts_earlier_name:
        raise ConfigError(f"{_EARLIER} has been renamed; write {_NAME} instead")
    output.note(f"{_EARLIER} has been renamed; write {_NAME}: the earlier name is taken until release {_ACCEPTED_UNTIL}")
    return earlier or None
