"""pip's settings of indexes, proxies and certificates, as options and environment variables of uv, which does not read them."""

import ast
import os
import subprocess
from pathlib import Path

_SECTIONS = ("global", "install", ":env:")
"""Sections of pip's configuration; a later one has precedence."""

_OPTIONS = {"index-url": "--index-url", "extra-index-url": "--extra-index-url", "find-links": "--find-links",
            "trusted-host": "--allow-insecure-host"}  # fmt: skip


def uv_settings(inner: Path) -> "tuple[list[str], dict[str, str]]":
    """Options and environment for uv, from the settings of the pip that belongs to the Python `inner`."""
    settings = read_pip_settings(inner)
    options = [word for key, option in _OPTIONS.items() for value in settings.get(key, "").split() for word in (option, value)]
    if settings.get("no-index", "").lower() in ("1", "true", "yes", "on"):
        options.append("--no-index")
    # Like pip: the version that the lock names, from whichever index has it. Hashes decide whether it is the right file.
    options += ["--index-strategy", "unsafe-best-match"]
    environment = dict(os.environ)
    if settings.get("cert"):
        environment.setdefault("SSL_CERT_FILE", settings["cert"])
    if settings.get("proxy"):
        environment.setdefault("HTTPS_PROXY", settings["proxy"])
        environment.setdefault("HTTP_PROXY", settings["proxy"])
    for key in ("timeout", "default-timeout"):
        if settings.get(key):
            environment.setdefault("UV_HTTP_TIMEOUT", settings[key])
    return options, environment


def read_pip_settings(inner: Path) -> "dict[str, str]":
    """Settings that `pip config list` prints: key without section -> value."""
    answer = subprocess.run([str(inner), "-m", "pip", "config", "list"], capture_output=True, text=True)
    return parse_pip_settings(answer.stdout) if answer.returncode == 0 else {}


def parse_pip_settings(text: str) -> "dict[str, str]":
    """Values of pip's configuration from lines such as `global.index-url='...'`, by precedence of their sections."""
    found = {}
    for line in text.splitlines():
        name, equals, value = line.partition("=")
        section, dot, key = name.rpartition(".")
        if equals and dot and section in _SECTIONS:
            try:
                found[section, key] = str(ast.literal_eval(value))
            except (SyntaxError, ValueError):
                continue
    return {key: value for section in _SECTIONS for (of, key), value in found.items() if of == section}
