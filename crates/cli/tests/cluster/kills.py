"""Kills the program at random times and compares the final files with those of an undisturbed run; see kills.sh."""

import datetime
import json
import random
import shutil
import signal
import subprocess
import sys
import tarfile
import time
from hashlib import sha256
from pathlib import Path

SCENES = "--scene-preset tiny --sequences 2 --images-per-scene 3 --label-every 2 --width 32 --height 24".split()


def main() -> int:
    program, kills, seed, place = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
    limit = 60 * float(sys.argv[5])
    draw = random.Random(seed)
    stages: dict[str, int] = {}
    expected = {pack: undisturbed(program, place / f"whole-{pack}" / "set", pack) for pack in (False, True)}
    took = {pack: expected[pack][2] for pack in expected}
    done = datasets = survived = 0
    begun = time.time()
    while done < kills and time.time() - begun < limit:
        pack = datasets % 2 == 1
        folder = place / "set"
        shutil.rmtree(folder, ignore_errors=True)
        plan(program, folder, pack)
        datasets += 1
        # Up to five kills per data set also test runs that start from the remains of several kills.
        for _ in range(draw.randint(1, 5)):
            if done >= kills:
                break
            command = "merge" if (folder / "shards/000000/manifest.jsonl").exists() else "run"
            most = took[pack] if command == "run" else 0.05
            if killed(program, command, folder, draw.uniform(0, 1.2 * most)):
                done += 1
                stage = stage_of(folder, command)
                stages[stage] = stages.get(stage, 0) + 1
            else:
                survived += 1
            finished(folder)
        call(program, "run", folder)
        found = call(program, "merge", folder)
        if digest(found) != expected[pack][0]:
            return fail(f"dataset {datasets}: {digest(found)}, expected {expected[pack][0]}")
        whole, found = expected[pack][1], content(folder)
        if found != whole:
            differ = {k for k in found.keys() | whole.keys() if found.get(k) != whole.get(k)}
            return fail(f"dataset {datasets}: other bytes in {sorted(differ)}")
        if remains := [str(p) for p in folder.rglob(".*partial")]:
            return fail(f"dataset {datasets}: left behind {remains}")
    print(f"date       {datetime.date.today().isoformat()}")
    print(f"dataset    {' '.join(SCENES)}, one shard, seed of the moments {seed}")
    print(f"kills      {done} (SIGKILL), {survived} runs ended before theirs")
    for stage, count in sorted(stages.items()):
        print(f"  {stage:<32}{count:>6}")
    print(f"datasets   {datasets}, half of them packed; every one ended with the bytes of an undisturbed run")
    print(f"seconds    {time.time() - begun:.0f}")
    return 0


def fail(text: str) -> int:
    print(f"FAILED: {text}")
    return 1


def plan(program: str, folder: Path, pack: bool) -> None:
    line = [program, "dataset", "plan", *SCENES, "-o", str(folder), "--sequences-per-shard", "2"]
    subprocess.run(line + ["--pack"] * pack, check=True, capture_output=True)


def command_line(program: str, command: str, folder: Path) -> list[str]:
    more = ["--shards", "0", "--threads", "1"] if command == "run" else []
    return [program, "dataset", command, str(folder), *more]


def call(program: str, command: str, folder: Path) -> str:
    return subprocess.run(command_line(program, command, folder), check=True, capture_output=True, text=True).stdout


def killed(program: str, command: str, folder: Path, after: float) -> bool:
    child = subprocess.Popen(command_line(program, command, folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        child.wait(timeout=after)
    except subprocess.TimeoutExpired:
        child.send_signal(signal.SIGKILL)
    return child.wait() == -signal.SIGKILL


def undisturbed(program: str, folder: Path, pack: bool) -> tuple[str, dict[str, str], float]:
    plan(program, folder, pack)
    begun = time.time()
    call(program, "run", folder)
    seconds = time.time() - begun
    return digest(call(program, "merge", folder)), content(folder), seconds


def digest(text: str) -> str:
    return next(line.removeprefix("digest ") for line in text.splitlines() if line.startswith("digest "))


def content(folder: Path) -> dict[str, str]:
    """Returns the digest of every file, except lock files and the shard manifest, which contain times or processes."""
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != "lock")
    shard = folder / "shards/000000/manifest.jsonl"
    return {str(p.relative_to(folder)): sha256(p.read_bytes()).hexdigest() for p in files if p != shard}


def finished(folder: Path) -> None:
    """Asserts that files with final names are complete: files of records have the recorded size, and packs are readable."""
    for record in folder.glob("shards/*/sequences/scene-*/record.json"):
        for file in json.loads(record.read_text())["files"]:
            assert (record.parent / file["path"]).stat().st_size == file["bytes"], record
    for sequence in folder.glob("shards/*/sequences/scene-*"):
        assert (sequence / "record.json").exists(), sequence
    for manifest in folder.glob("shards/*/manifest.jsonl"):
        assert all(json.loads(line) for line in manifest.read_text().splitlines())
    for pack in folder.glob("shards/[0-9]*.tar"):
        with tarfile.open(pack) as tar:
            names = tar.getnames()
        assert sum(name.endswith(".split.txt") for name in names) == 2, pack
    manifest = folder / "manifest.jsonl"
    if manifest.exists():
        assert len(manifest.read_text().splitlines()) == 3


def stage_of(folder: Path, command: str) -> str:
    """Returns the stage at which a kill stopped the command, derived from the remaining files."""
    if command == "merge":
        return "merge"
    if (folder / "shards/000000.tar").exists() or list(folder.glob("shards/.*.partial")):
        return "pack"
    hidden = list(folder.glob("shards/*/sequences/.*.partial"))
    if hidden:
        return "labels" if (hidden[0] / "labels").exists() else "streams and images"
    return "between sequences" if list(folder.glob("shards/*/sequences/scene-*")) else "before the first file"


if __name__ == "__main__":
    sys.exit(main())
