"""The ways a run can end without an answer. Nothing else is imported here, so every package may use it."""


class InputError(ValueError):
    """What the user gave is wrong: a key, a range, a file, a folder. The program ends with status 2."""


class ConvergenceError(RuntimeError):
    """A solver gave up: the message says what, where and what to try. The program ends with status 3."""


class LoadingStopped(ConvergenceError):
    """Load steps that became too small; `fact` is where, without advice."""

    def __init__(self, fact: str) -> None:
        super().__init__(
            f"{fact}. The tire may fold or buckle here: lower the load or raise the inflation, stiffen "
            "the material or refine the mesh around the footprint."
        )
        self.fact = fact
