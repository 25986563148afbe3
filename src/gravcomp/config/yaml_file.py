"""Reading YAML, with errors that name the file, or where else it comes from, line and column."""

import contextlib
from pathlib import Path
from typing import Any

import yaml

from gravcomp.config.errors import ConfigError

_DEEPEST = 200
"""Values within values: PyYAML's own reader takes a time that grows with the square of the depth, until Python's stack ends."""

_LARGEST = 10_000
"""Characters that begin a value in another one, so few that libyaml can make the values: 100,000 in each other end its stack."""


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is given twice; PyYAML silently keeps the last value."""


class _FastLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The same by libyaml, ten times as fast, where PyYAML has it; its errors are less precise."""


def _mapping_without_repeats(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict:
    seen = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node)
        if key in seen:
            raise yaml.MarkedYAMLError(problem=f"the key '{key}' is given twice", problem_mark=key_node.start_mark)
        seen.add(key)
    return loader.construct_mapping(node)


for _loader in (_StrictLoader, _FastLoader):
    _loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_repeats)


def load_yaml(path: str | Path) -> Any:
    """Return the document in the file. Raises ConfigError when the file cannot be read or is not YAML."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not a UTF-8 text file") from error
    return parse_yaml(text, path)


def _refuse_depth(text: str) -> None:
    """Raise RecursionError where the values that are read before an error are nested too deeply."""
    depth = 0
    with contextlib.suppress(yaml.YAMLError):  # it will be raised again, more precisely
        for event in yaml.parse(text, Loader=_FastLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise RecursionError


def parse_yaml(text: str, source: str | Path) -> Any:
    """Return the document in the text. Raises ConfigError, which begins with `source`, when it is not YAML."""
    try:
        if sum(map(text.count, "[{-?:")) >= _LARGEST:
            _refuse_depth(text)
        with contextlib.suppress(yaml.YAMLError):
            return yaml.load(text, Loader=_FastLoader)
        _refuse_depth(text)
        return yaml.load(text, Loader=_StrictLoader)
    except RecursionError as error:
        raise ConfigError(f"{source}: is nested too deeply") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigError(f"{source}{place}: {error.problem}") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{source}: is not YAML: {error}") from error
