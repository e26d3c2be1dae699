"""A Slurm of one node for a test: munged, slurmctld and slurmd, started as root and ended again."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel", "scontrol")
CONFIGURATION = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
MpiDefault=none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SlurmUser=root
SlurmdUser=root
SlurmctldPort={control}
SlurmdPort={daemon}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SelectType=select/cons_res
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=sched_interval=1,bf_interval=1
JobRequeue=1
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def _free_ports() -> tuple[int, int]:
    with socket.socket() as one, socket.socket() as two:
        one.bind(("127.0.0.1", 0))
        two.bind(("127.0.0.1", 0))
        return one.getsockname()[1], two.getsockname()[1]


@contextmanager
def slurm(folder: Path) -> Iterator[dict[str, str]]:
    """The environment in which sbatch reaches it. Skips the test, with the reason, where it cannot start."""
    path = f"{os.environ['PATH']}:/usr/sbin:/sbin"
    missing = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    if os.geteuid() or missing:
        pytest.skip(f"no Slurm of one node: {'not root' if os.geteuid() else f'no {missing[0]}'}")
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    for one in (folder, *folder.parents):
        if one.is_relative_to("/tmp") and one != Path("/tmp"):
            one.chmod(0o755)  # munged demands it of every folder above its socket
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    control, daemon = _free_ports()
    host = socket.gethostname().partition(".")[0]
    given = {"folder": folder, "host": host, "control": control, "daemon": daemon}
    (folder / "slurm.conf").write_text(CONFIGURATION.format(**given, cores=os.cpu_count()))
    environment = {**os.environ, "PATH": path, "SLURM_CONF": str(folder / "slurm.conf")}
    munge = [f"--key-file={key}", f"--socket={folder}/munge.socket", f"--pid-file={folder}/m.pid"]
    munge += [f"--log-file={folder}/munge.log", f"--seed-file={folder}/munge.seed"]
    daemons = []
    try:
        for line in (["munged", "-F", "--force", *munge], ["slurmctld", "-D"], ["slurmd", "-D"]):
            with (folder / f"{line[0]}.txt").open("wb") as log:
                daemons.append(
                    subprocess.Popen(line, env=environment, stdout=log, stderr=subprocess.STDOUT)
                )
            time.sleep(1)
        _wait_for_node(environment, folder)
        yield environment
    finally:
        for one in reversed(daemons):
            one.terminate()
        for one in reversed(daemons):
            one.wait(timeout=60)


def _wait_for_node(environment: dict[str, str], folder: Path) -> None:
    end = time.monotonic() + 60
    while time.monotonic() < end:
        said = subprocess.run(
            ["sinfo", "-h", "-o", "%t"], env=environment, capture_output=True, text=True
        )
        if said.stdout.strip() == "idle":
            return
        time.sleep(0.5)
    texts = " | ".join(file.read_text()[-300:] for file in sorted(folder.glob("*.txt")))
    pytest.skip(f"no Slurm of one node: it did not start: {texts}")


def ended(environment: dict[str, str], seconds: float) -> None:
    """Wait until the queue is empty."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        said = subprocess.run(
            ["squeue", "-h", "-o", "%i %T %r"], env=environment, capture_output=True, text=True
        )
        if not said.returncode and not said.stdout.strip():
            return
        time.sleep(1)
    raise AssertionError(f"still in the queue after {seconds:g} s: {said.stdout} {said.stderr}")
