#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# The Snakemake workflow over many small sweeps, killed three times: none is lost, none made twice.
#   workflow.py PLUMB SWEEPS FRAMES
# The sweeps are windows of two simulated ones, so that each has another content.
import csv
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SNAKEFILE = pathlib.Path(__file__).resolve().parents[2] / "toolchain" / "workflow" / "Snakefile"
LONGEST_WAIT_S = 3000
SKIPPED = 77


def window(recording, first, frames, sweep):
    """Frames of a recording in the TUM layout, as a recording of its own."""
    sweep.mkdir(parents=True)
    shutil.copy(recording / "camera.yaml", sweep)
    for kind in ("rgb", "depth"):
        (sweep / kind).mkdir()
        lines = [line for line in (recording / f"{kind}.txt").read_text().splitlines()
                 if not line.startswith("#")][first : first + frames]  # fmt: skip
        assert len(lines) == frames, f"{recording} has too few frames"
        (sweep / f"{kind}.txt").write_text("".join(line + "\n" for line in lines))
        for line in lines:
            name = line.split()[1]
            os.link(recording / name, sweep / name)


def make_sweeps(plumb, folder, count, frames):
    subprocess.run(
        [plumb, "simulate", "--suite", "demo", "--seed", "5", "--size", "320x240", "--frames",
         str(frames + (count + 1) // 2), "--out", folder / "suite"],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    recordings = sorted((folder / "suite" / "recordings").iterdir())[:2]
    sweeps = [folder / "sweeps" / f"{number:04}" for number in range(count)]
    for number, sweep in enumerate(sweeps):
        window(recordings[number % 2], number // 2, frames, sweep)
    (folder / "sweeps.list").write_text("".join(f"{sweep}\n" for sweep in sweeps))
    return sweeps


def finished(folder):
    """What tells whether a scene was made again: by name, inode and time of its first file."""
    found = {}
    if (folder / "scenes").is_dir():
        for scene in (folder / "scenes").iterdir():
            if not scene.name.startswith(".") and (scene / "scene.json").exists():
                state = (scene / "scene.json").stat()
                found[scene.name] = (state.st_ino, state.st_mtime_ns)
    return found


def start(plumb, folder, *options):
    command = ["snakemake", "--snakefile", SNAKEFILE, "--cores", "2", "--keep-going", "--quiet",
               "all", "--config", f"plumb={plumb}"]  # fmt: skip
    command[3:3] = options
    log = open(folder / "log", "a")
    return subprocess.Popen(
        command, cwd=folder, stdout=log, stderr=log, start_new_session=True,
        env={**os.environ, "XDG_CACHE_HOME": str(folder / "cache")},
    )  # fmt: skip


def kill_at(plumb, folder, count):
    """Kills everything as soon as so many scenes are there."""
    run = start(plumb, folder, "--rerun-incomplete")
    end = time.monotonic() + LONGEST_WAIT_S
    while len(finished(folder)) < count:
        assert run.poll() is None, (folder / "log").read_text()
        assert time.monotonic() < end, "the workflow does not go on"
        time.sleep(0.01)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert start(plumb, folder, "--unlock").wait() == 0, (folder / "log").read_text()
    return finished(folder)


def main(plumb, count, frames):
    if not shutil.which("snakemake"):
        print("snakemake is not installed")
        return SKIPPED
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        sweeps = make_sweeps(plumb, folder, count, frames)
        before = {}
        for part in (0.2, 0.5, 0.8):
            there = kill_at(plumb, folder, max(1, int(part * count)))
            # Nothing that was finished before an earlier kill was touched.
            assert {name: there.get(name) for name in before} == before
            assert len(there) < count, "the last kill came too late"
            before = there
        run = start(plumb, folder, "--rerun-incomplete")
        assert run.wait(LONGEST_WAIT_S) == 0, (folder / "log").read_text()
        there = finished(folder)
        assert {name: there.get(name) for name in before} == before
        with open(folder / "scenes" / "scenes.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        assert [row["input"] for row in rows] == [str(sweep) for sweep in sweeps], "one is lost"
        assert {row["exit_code"] for row in rows} == {"0"}
        outputs = [row["output"] for row in rows]
        assert len(set(outputs)) == count and set(outputs) == set(there), "one is there twice"
        left = [path.name for path in (folder / "scenes").iterdir() if ".plumb-" in path.name]
        assert not left, left
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{count} sweeps of {frames} frames: {used.ru_utime + used.ru_stime:.0f} CPU seconds")
    return 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3])))
