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


class HalfMade:
    """An object whose finaliser needs what its constructor did not reach."""

    def __init__(self) -> None:
        raise signals.Stopped("SIGHUP")

    def __del__(self) -> None:
        print(self.part)  # type: ignore[attr-defined]


@pytest.mark.parametrize("raised, told", [("", True), ("SIGHUP", False)])
def test_what_a_request_left_half_made_fails_in_silence(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], raised: str, told: bool
) -> None:
    """A finaliser's traceback came before the sentence that says how to continue."""
    monkeypatch.setattr(signals._Heard, "raised", raised)
    monkeypatch.setattr("sys.unraisablehook", signals._not_lost)
    with pytest.raises(signals.Stopped):
        HalfMade()
    assert ("Traceback" in capfd.readouterr().err) == told
