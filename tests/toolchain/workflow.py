#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Snakemake workflow over many small sweeps, killed three times: none is lost, none made twice.

  workflow.py PLUMB SWEEPS FRAMES             on this machine, two jobs at a time
  workflow.py PLUMB SWEEPS FRAMES --slurm     on a Slurm of two nodes (slurm_host.py), as root
  workflow.py PLUMB SWEEPS FRAMES --speed-up  killed never; wall times with one and with two jobs

The sweeps are windows of two simulated ones, so that each has another content.
"""
import argparse
import contextlib
import csv
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from slurm_host import NODES, SlurmHost

WORKFLOW = pathlib.Path(__file__).resolve().parents[2] / "toolchain" / "workflow"
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


class Here:
    """Jobs as processes of this machine."""

    environment = dict(os.environ)

    def __init__(self, jobs=2):
        self.options = ["--cores", str(jobs), "--keep-going", "--rerun-incomplete"]

    def kill_jobs(self):
        """Nothing is left of them: they are killed with Snakemake."""


class OnSlurm:
    """Jobs of Slurm, by the profile that the workflow's README gives."""

    def __init__(self, slurm, folder):
        self.environment = slurm.environment
        profile = folder / "profile"
        profile.mkdir()
        text = (WORKFLOW / "README.md").read_text().partition("## On Slurm")[2]
        lines = re.search(r"(?:^    .*\n)+", text, re.MULTILINE).group()
        (profile / "config.yaml").write_text(lines.replace("\n    ", "\n").removeprefix("    "))
        self.options = ["--profile", str(profile)]
        self._kills = 0

    def kill_jobs(self):
        """The first time they go on without Snakemake, as after a cut connection."""
        self._kills += 1
        if self._kills > 1:
            subprocess.run(["scancel", "--user=root"], env=self.environment, check=True)


def start(plumb, folder, runner, *options):
    log = open(folder / "log", "a")
    return subprocess.Popen(
        ["snakemake", "--snakefile", WORKFLOW / "Snakefile", *runner.options, *options, "--quiet",
         "all", "--config", f"plumb={plumb}"],
        cwd=folder, stdout=log, stderr=log, start_new_session=True,
        env={**runner.environment, "XDG_CACHE_HOME": str(folder / "cache")},
    )  # fmt: skip


def kill_at(plumb, folder, runner, count):
    """Kills everything as soon as so many scenes are there."""
    run = start(plumb, folder, runner)
    end = time.monotonic() + LONGEST_WAIT_S
    while len(finished(folder)) < count:
        assert run.poll() is None, (folder / "log").read_text()
        assert time.monotonic() < end, "the workflow does not go on"
        time.sleep(0.01)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    there = finished(folder)
    runner.kill_jobs()
    assert start(plumb, folder, runner, "--unlock").wait() == 0, (folder / "log").read_text()
    return there


def finish(plumb, folder, runner):
    run = start(plumb, folder, runner)
    assert run.wait(LONGEST_WAIT_S) == 0, (folder / "log").read_text()


def check_killed_workflow(plumb, folder, runner, sweeps):
    count = len(sweeps)
    before = {}
    for part in (0.2, 0.5, 0.8):
        there = kill_at(plumb, folder, runner, max(1, int(part * count)))
        # Nothing that was finished before an earlier kill was touched.
        assert {name: there.get(name) for name in before} == before
        assert len(there) < count, "the last kill came too late"
        before = there
    finish(plumb, folder, runner)
    there = finished(folder)
    assert {name: there.get(name) for name in before} == before
    # Each sweep is the work of its own job: the last step finds all scenes.
    jobs = [json.loads((folder / "work" / f"{number}.jsonl").read_text()) for number in range(count)]
    assert [job["input"] for job in jobs] == [str(sweep) for sweep in sweeps]
    lines = (folder / "work" / "scenes.jsonl").read_text().splitlines()
    assert len(lines) == count and all(json.loads(line)["reused"] for line in lines)
    with open(folder / "scenes" / "scenes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["input"] for row in rows] == [str(sweep) for sweep in sweeps], "one is lost"
    assert {row["exit_code"] for row in rows} == {"0"}
    outputs = [row["output"] for row in rows]
    assert len(set(outputs)) == count and set(outputs) == set(there), "one is there twice"
    left = [path.name for path in (folder / "scenes").iterdir() if ".plumb-" in path.name]
    assert not left, left


def measure_speed_up(plumb, folder):
    wall_s = []
    for jobs in (1, 2):
        for made in ("scenes", "work", ".snakemake"):
            shutil.rmtree(folder / made, ignore_errors=True)
        began = time.monotonic()
        finish(plumb, folder, Here(jobs))
        wall_s.append(time.monotonic() - began)
        print(f"{jobs} at a time: {wall_s[-1]:.0f} s")
    print(f"two jobs are {wall_s[0] / wall_s[1]:.2f} times as fast as one")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plumb", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("sweeps", type=int)
    parser.add_argument("frames", type=int)
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--slurm", action="store_true")
    how.add_argument("--speed-up", action="store_true")
    options = parser.parse_args()
    if not shutil.which("snakemake"):
        print("snakemake is not installed")
        return SKIPPED
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = pathlib.Path(name)
        sweeps = make_sweeps(options.plumb, folder, options.sweeps, options.frames)
        if options.speed_up:
            measure_speed_up(options.plumb, folder)
        else:
            slurm = stack.enter_context(SlurmHost(folder)) if options.slurm else None
            runner = OnSlurm(slurm, folder) if slurm else Here()
            began = time.monotonic()
            check_killed_workflow(options.plumb, folder, runner, sweeps)
            print(f"{time.monotonic() - began:.0f} s with three kills")
            for node in NODES if slurm else ():
                log = (folder / "slurm" / f"{node}.log").read_text()
                assert "Launching batch job" in log, f"{node} had no work"
                print(f"{node}: {log.count('Launching batch job')} jobs")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{options.sweeps} sweeps of {options.frames} frames: "
          f"{used.ru_utime + used.ru_stime:.0f} CPU seconds of this script's programs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
