"""Exceptions that end a run without a result. Imports nothing, so all packages may use it."""


class InputError(ValueError):
    """Invalid input: a key, a range, a file or a folder. The program ends with status 2."""


class UnsuitedSettings(InputError):
    """Elements or contact points on which the problem cannot be solved; others may do.

    A search for settings counts it as their result and tries others.
    """


class ConvergenceError(RuntimeError):
    """A solver failed; the message says what, where and what to try. Exit status 3."""


class NearlySingular(ConvergenceError):
    """A linear system that has no accurate solution; only its owner knows why."""


class LoadingStopped(ConvergenceError):
    """The load steps became too small; `fact` says where, without advice."""

    def __init__(self, fact: str) -> None:
        super().__init__(
            f"{fact}. The tire may fold or buckle here: lower the load or raise the inflation, stiffen "
            "the material or refine the mesh around the footprint."
        )
        self.fact = fact
