"""The steps of making a mesh, shown with the seconds that have passed."""

import logging
import re

import pytest

from gravcomp.commands import output
from gravcomp.commands.mesh_steps import mesh_steps


def test_steps_that_are_logged_are_shown_with_the_seconds(capsys):
    logger = logging.getLogger("gravcomp.mesh_files.filling")
    before = logging.getLogger("gravcomp").level
    with mesh_steps("choosing the mesh"):
        logger.info("%s: filled by %s", "body.stl", "Gmsh")
        logger.debug("not shown")
    logger.info("not shown any more")
    assert re.fullmatch(r"choosing the mesh\n\d+ s: body\.stl: filled by Gmsh\n", capsys.readouterr().err)
    assert logging.getLogger("gravcomp").level == before


def test_warnings_are_printed_as_elsewhere(capsys, monkeypatch):
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # as in a command; pytest has its own
    with mesh_steps("choosing the mesh"):
        logging.getLogger("gravcomp.full_model.size_choice").warning("too coarse")
    assert capsys.readouterr().err == "choosing the mesh\ntoo coarse\n"


def test_quiet_shows_no_steps(capsys, monkeypatch):
    monkeypatch.setattr(output._options, "quiet", True)
    with mesh_steps("choosing the mesh"):
        logging.getLogger("gravcomp.mesh_files.filling").info("filled")
    assert capsys.readouterr().err == ""


def test_the_steps_end_with_an_error():
    with pytest.raises(ValueError, match="no mesh"), mesh_steps("choosing the mesh"):
        raise ValueError("no mesh")
    assert not [handler for handler in logging.getLogger("gravcomp").handlers if handler.level == logging.INFO]
