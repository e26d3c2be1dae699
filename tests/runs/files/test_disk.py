"""What killed runs left in a folder is removed by the next one, and nothing that is still written."""

import os
import socket
import subprocess
import sys
from pathlib import Path

from tireroad.runs.files.disk import part_of, remove_leftovers


def test_leftovers_of_the_dead_are_removed(tmp_path: Path) -> None:
    """Of a process of this machine that has ended; not of one that lives, nor of another machine."""
    dead = subprocess.Popen(["true"])
    dead.wait()
    own = part_of(tmp_path / "contact.h5")
    gone = own.with_name(own.name.replace(f".{os.getpid()}.", f".{dead.pid}."))
    alive = own.with_name(own.name.replace(f".{os.getpid()}.", f".{os.getppid()}."))
    elsewhere = tmp_path / f".contact.h5.elsewhere.{dead.pid}.part"
    for path in (gone, alive, elsewhere):
        path.write_text("")
    remove_leftovers(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([alive, elsewhere])


def test_a_process_that_is_over_or_younger_than_a_file_does_not_write_it(tmp_path: Path) -> None:
    """A killed process that nobody has waited for answers signals still; and numbers of processes come round."""
    over = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, over.pid, os.WEXITED | os.WNOWAIT)
    old, now = (
        tmp_path / f".{name}.h5.{socket.gethostname()}.{os.getppid()}.part" for name in "ab"
    )
    left = tmp_path / f".c.h5.{socket.gethostname()}.{over.pid}.part"
    for path in (old, now, left):
        path.write_text("")
    os.utime(old, (1e9, 1e9))
    remove_leftovers(tmp_path)
    over.wait()
    assert list(tmp_path.iterdir()) == [now]
