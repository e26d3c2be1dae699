"""Damage files of a result folder and use it: recomputed, left out or refused, never wrong or a crash.

    PYTHONPATH=.:tests:tests/stress python3 tests/stress/damaged_files.py --files 200 --seed 1

Bits flipped, bytes made random, blocks made zero, files cut, emptied or removed, in finished runs and
in stopped ones with a checkpoint; then run, resume, report, export or info, each in a forked copy of this
process, which has the program imported.
"""

import argparse
import random
import shutil
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from attack import command, content, differences, finished, started, told, write_scene
from in_child import forked, warm

USES = ("run", "run", "run", "resume", "resume", "export", "info", "info", "report")
LIMIT = 900.0  # s for a use on a busy machine


def attack(folder: Path, files: int, seed: int) -> list[str]:
    """Damage one file at a time; what went wrong, one line each."""
    dice, failures = random.Random(seed), []
    warm()
    scene, whole, stopped = write_scene(folder), folder / "whole", folder / "stopped"
    # In a fork like all that follows: what other tests of this process left behind is in both.
    run = ["run", str(scene), "--out", str(whole)]
    status, text, _ = forked(partial(_program, run), folder / "said.txt", LIMIT)
    if status:
        return [f"the undamaged run ended with {status}: {text}"]
    wanted = content(whole)
    shutil.copytree(whole, stopped)
    for name in ("contact.h5", "spectra.h5", "response.h5"):
        (stopped / name).unlink(missing_ok=True)
    _stop_in_the_loop(scene, stopped)
    csv = _exported(whole)
    for number in range(files):
        out = folder / "damaged"
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(dice.choice([whole, whole, stopped]), out)
        victim = dice.choice(sorted([*out.glob("*.h5"), *out.glob("*.h5"), *out.glob("s*.[jt]*")]))
        what = _damage(victim, dice)
        use = dice.choice(USES)
        found = [
            f"{number}: {victim.name} {what}, {use}: {failure}"
            for failure in _used(scene, out, victim, use, wanted, csv)
        ]
        print(*found, sep="\n", end="\n" if found else "", flush=True)
        failures += found
        if number % 10 == 9:
            print(f"{number + 1} files, {len(failures)} failures", flush=True)
    return failures


def _stop_in_the_loop(scene: Path, out: Path) -> None:
    with started(command("run", scene, "--out", out)) as process:
        while not (out / "checkpoint.h5").exists():
            assert process.poll() is None, process.communicate()
            time.sleep(0.002)
        process.terminate()
        process.communicate()
    assert process.returncode == 4 and (out / "checkpoint.h5").exists()


def _exported(out: Path) -> dict[str, bytes]:
    status, text = finished(command("export", out))
    assert status == 0, text
    tables = {path.name: path.read_bytes() for path in (out / "export").glob("*.csv")}
    shutil.rmtree(out / "export")
    return tables


def _damage(path: Path, dice: random.Random) -> str:
    """Change a file; how, in words."""
    data = bytearray(path.read_bytes())
    place, how = dice.randrange(len(data)), dice.randrange(6)
    if how == 0:
        data[place] ^= 1 << dice.randrange(8)
    elif how == 1:
        for _ in range(50):
            data[dice.randrange(len(data))] = dice.randrange(256)
    elif how == 2:
        start = place // 512 * 512
        zeros = bytes(min(4096, len(data) - start))
        if data[start : start + len(zeros)] == zeros:
            data[start] = 1
        else:
            data[start : start + len(zeros)] = zeros
    elif how == 3:
        del data[place:]
    elif how == 4:
        data += dice.randbytes(dice.randrange(1, 1000))
    else:
        path.unlink()
        return "removed"
    path.write_bytes(data)
    return f"{('bit', 'bytes', 'zeros', 'cut', 'longer')[how]} at {place}"


def _used(
    scene: Path, out: Path, victim: Path, use: str, wanted: dict, csv: dict[str, bytes]
) -> list[str]:
    """Use the damaged folder; what is wrong with what came of it."""
    arguments = {
        "run": ["run", str(scene), "--out", str(out), "--until", "spectra"],
        "info": ["info", str(victim)],
    }.get(use, [use, str(out)])
    same = not victim.exists()

    status, text, _ = forked(partial(_program, arguments), scene.with_name("said.txt"), LIMIT)
    if "Traceback" in text or status not in (0, 2):
        return [f"status {status}: {text}"]
    if status == 2 and not ("error: " in text and text.count("\n") < 40):
        return [f"no clear message: {text}"]
    if status == 0 and use == "info" and not same:
        return [f"damage not seen: {text}"]
    if status == 0 and use in ("run", "resume"):
        return [f"differs: {name}" for name in differences(wanted, content(out))]
    if status == 0 and use == "export":
        made = {path.name: path.read_bytes() for path in (out / "export").glob("*.csv")}
        return [f"{name} differs" for name in made if made[name] != csv[name]]
    # What the page takes of the others stands in summary.json and spectra.h5.
    shown = not same and victim.name not in ("greens.h5", "checkpoint.h5", "accuracy.h5")
    if status == 0 and use == "report" and shown and victim.name not in _page(out):
        return ["the page does not name the damaged file"]
    return []


def _program(arguments: list[str]) -> int:
    from tireroad.runs.cli import main

    return main(arguments)


def _page(out: Path) -> str:
    return (out / "report.html").read_text(encoding="utf-8")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--files", type=int, default=200)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        found = attack(Path(name), given.files, given.seed)
    sys.exit(told(found, given.files, "damaged files"))
