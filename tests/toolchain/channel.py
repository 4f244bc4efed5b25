#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# channel.py: toolchain/channel signs no index that every unit would refuse (channel_index.cpp).
import json
import pathlib
import subprocess
import sys
import tempfile

CHANNEL = pathlib.Path(__file__).resolve().parents[2] / "toolchain" / "channel"


def run(folder, names, *more):
    for path in folder.glob("*.raucb"):
        path.unlink()
    for name in names:
        (folder / name).write_text("bundle")
    return subprocess.run(
        [CHANNEL, folder, "--key", folder / "key.pem", *more], capture_output=True, text=True
    )


def expect_refusal(folder, names, words):
    before = (folder / "index.json").read_bytes()
    made = run(folder, names)
    assert made.returncode != 0, f"signed: {names[:2]}"
    assert words in made.stderr, made.stderr
    assert (folder / "index.json").read_bytes() == before


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        longest = "p" * (64 - len("-0.3.1.raucb")) + "-0.3.1.raucb"
        made = run(folder, [longest, "plumb-0.3.2.raucb"], "--share", "plumb-0.3.2.raucb=0.25")
        assert made.returncode == 0, made.stderr
        index = json.loads((folder / "index.json").read_text())
        assert sorted(one["share"] for one in index["bundles"]) == [0.25, 1.0], index
        made = run(folder, [f"plumb-0.{n}.raucb" for n in range(64)])
        assert made.returncode == 0, made.stderr
        expect_refusal(folder, ["p" + longest], "at most 64 letters")
        expect_refusal(folder, ["plumb-" + "1" * 33 + ".raucb"], "expected a name")
        expect_refusal(folder, ["-0.3.1.raucb"], "expected a name")
        expect_refusal(folder, [f"plumb-0.{n}.raucb" for n in range(65)], "at most 64")


sys.exit(main())
