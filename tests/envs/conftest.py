"""No window opens in tests: SDL draws into memory."""

import warnings

import pytest

pytest.importorskip("gymnasium")


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture
def advice_ignored():
    """Gymnasium advises against unbounded observations and inputs in physical units; anything else is an error."""
    with warnings.catch_warnings():
        for advice in ("Box observation space .*infinity", "we recommend using a symmetric and normalized space"):
            warnings.filterwarnings("ignore", message=f".*{advice}")
        yield
