"""Set up the tests of the core: no reduced model of the user's cache takes part in them."""

import pytest
from coarse_article import keep_compiled, of_the_run


@pytest.fixture(scope="module", autouse=True)
def _no_stored_models(tmp_path_factory: pytest.TempPathFactory):
    """Use a cache without reduced models: whether somebody has built that of a test's robot must not count."""
    folder = of_the_run(tmp_path_factory) / "gravcomp_cache_without_models"
    keep_compiled(folder, "mesh", "firmware")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRAVCOMP_CACHE", str(folder))
        yield
