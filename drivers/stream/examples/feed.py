#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Feeds Plumb with frames: feed.py SOCKET FOLDER

Frames() plays a folder of raw images (hello.json, NNNN.color, NNNN.depth) back and forth. Put your
camera's SDK there: kind, stamp in microseconds at mid-exposure, bytes. Protocol: ../README.md.
"""
import itertools
import json
import pathlib
import socket
import struct
import sys
import time

HELLO, COLOR, DEPTH = 1, 2, 3


def Message(kind, payload, stamp_us=0):
    return struct.pack("<4sIQq", b"PLMB", kind, len(payload), stamp_us) + payload


def Frames(folder, rate_hz):
    names = sorted(path.stem for path in folder.glob("*.color"))
    start = time.monotonic()
    for number, name in enumerate(itertools.cycle(names + names[-2:0:-1])):
        time.sleep(max(0.0, start + number / rate_hz - time.monotonic()))
        stamp_us = round(1e6 * number / rate_hz)
        yield COLOR, stamp_us, (folder / f"{name}.color").read_bytes()
        yield DEPTH, stamp_us, (folder / f"{name}.depth").read_bytes()


def Answers(connection, left=b""):
    """The lines that Plumb has sent so far, without waiting."""
    try:
        left += connection.recv(4096, socket.MSG_DONTWAIT)
    except (BlockingIOError, ConnectionResetError):
        pass
    *lines, left = left.split(b"\n")
    return [json.loads(line) for line in lines]


def main():
    address, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    hello = json.loads((folder / "hello.json").read_text())
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        connection.sendall(Message(HELLO, json.dumps(hello).encode()))
        try:
            for kind, stamp_us, pixels in Frames(folder, hello["rate_hz"]):
                connection.sendall(Message(kind, pixels, stamp_us))
                for answer in Answers(connection):
                    print(answer, flush=True)  # {"lock_exposure": true}: keep the exposure now.
        except (BrokenPipeError, ConnectionResetError):
            print("Plumb hung up:", *Answers(connection))
            return 1


if __name__ == "__main__":
    sys.exit(main())
