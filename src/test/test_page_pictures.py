"""The moments of the run at which pictures of the page are taken."""

import pytest

from gravcomp.commands import page_pictures
from gravcomp.commands.page_pictures import PagePictures


def test_a_moment_is_its_own_however_late_it_is_seen(tmp_path, monkeypatch):
    """A picture of the sagging robot must not show the compensated one because the machine was busy."""
    monkeypatch.setattr(page_pictures, "find_chromium", lambda: tmp_path)
    pictures = PagePictures(tmp_path, {"sagging": 3.2, "compensated": 6.0})
    for elapsed, now in ((2.9, 102.9), (4.1, 104.1), (6.0, 106.0), (7.0, 107.0)):
        pictures.follow(elapsed, now)
    assert pictures._times == {"sagging": pytest.approx(103.2), "compensated": pytest.approx(106.0)}
