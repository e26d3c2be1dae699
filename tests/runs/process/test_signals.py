"""A stop signal where an exception must not be raised."""

from __future__ import annotations

import os
import signal
import time
from importlib.machinery import ExtensionFileLoader

import pytest

from tireroad.runs.process import signals


class Native(ExtensionFileLoader):
    """A library whose compiled part calls Python code while it is loaded."""

    def create_module(self, spec: object) -> object:
        os.kill(os.getpid(), signal.SIGTERM)
        return sum(range(10))


def test_a_request_during_a_compiled_import_is_raised_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Raised within, it passed through C++ as an exception: SIGABRT, status 1."""
    monkeypatch.setattr(signals._Heard, "at", -1e9)
    monkeypatch.setattr(signals._Heard, "raised", "")
    before = signal.signal(signal.SIGTERM, signals._stop)
    try:
        assert Native("library", "library.so").create_module(None) == 45
        with pytest.raises(signals.Stopped, match="SIGTERM"):
            time.sleep(60)
    finally:
        signal.signal(signal.SIGTERM, before)
