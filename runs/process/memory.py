"""How much memory this process has taken."""

import resource
from pathlib import Path


def peak_memory() -> float:
    """Largest resident memory of this process since it began, bytes.

    Linux carries the maximum of getrusage over from the process that started this one: there it is
    read from /proc.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (own,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
    return 1024.0 * float(own)
