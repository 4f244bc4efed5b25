# SPDX-License-Identifier: Apache-2.0
"""For toolchain/test-image: what the units of an image have done in their sandboxes, as systemd,
its journal and the kernel say, and DICOM from outside."""

import re
import subprocess
import time

from image_test.machine import Run, expect, fail, say

# What a unit prints to which its sandbox has refused something, or which could do half of its work.
REFUSED = (r"operation not permitted|permission denied|read-only file system|cannot mark|"
           r"cannot be put back|failed to set up|no such file")


def show(machine, unit, *keys):
    asked = " ".join(f"-p {key}" for key in keys)
    return machine.ask_sh(f"systemctl show {unit} {asked} | sort").replace("\n", " ")


def expect_sandbox(machine, unit):
    """As the running systemd has it, with the image's own additions."""
    score = machine.ask_sh(f"systemd-analyze security --no-pager {unit} | tail -1")
    found = re.search(r"level for \S+: ([0-9.]+) ", score)
    if not found or float(found[1]) > 2.0:
        fail(f"{unit}: expected a score of at most 2.0: {score}")
    say(f"ok      {unit}: {found[0].strip()}")


def expect_said(machine, unit, pattern, boot=0):
    """In the journal of this start (boot -1: the one before)."""
    said = machine.ask_sh(f"journalctl -b {boot} -u {unit} -o cat --no-pager")
    if trouble := re.search(f"(?i).*({REFUSED}).*", said):
        fail(f"{unit} says: {trouble[0]}")
    expect(f"{unit} says", pattern, said.replace("\n", " | "))


def check_gate(machine):
    """The gate has run and marked the system good."""
    unit = "plumb-mark-good.service"
    expect(f"{unit} has ended well", "^ActiveState=active ExecMainStatus=0 Result=success "
           "SubState=exited$",
           show(machine, unit, "ActiveState", "SubState", "Result", "ExecMainStatus"))
    expect_said(machine, unit, "is marked good")
    for one in (unit, "plumb-roll-back.service", "plumb-dicomd.service", "plumbd.service"):
        expect_sandbox(machine, one)


def check_roll_back(machine):
    """In the start before this one the gate refused, and the machine went back."""
    expect_said(machine, "plumb-mark-good.service", "not marked good", boot=-1)
    expect_said(machine, "plumb-roll-back.service", "is not fit for work: restarting", boot=-1)
    # It restarts the machine itself, so that systemd may end it on the way down.
    expect("systemd started it", "Starting.*plumb-roll-back|Starting.*Restart into the previous",
           machine.ask_sh("journalctl -b -1 --no-pager -o cat UNIT=plumb-roll-back.service"))


def echo(machine, title):
    return subprocess.run(["echoscu", "-to", "10", "-aet", title, "-aec", "PLUMB", "127.0.0.1",
                           str(machine.dicom_port)], capture_output=True, text=True)


def check_dicom(machine):
    """plumb-dicomd is off as delivered; with the key it answers a known sender and no other."""
    unit = "plumb-dicomd.service"
    expect("as delivered the receiver has ended by itself", "^ActiveState=inactive "
           "NRestarts=0 Result=success UnitFileState=enabled$",
           show(machine, unit, "ActiveState", "NRestarts", "Result", "UnitFileState"))
    address = re.search(r"inet ([0-9.]+)/", machine.ask_sh("ip -4 -o addr show scope global"))[1]
    lines = (r'enabled = true\nlisten = "%s:11112"\nsenders = ["KNOWN@10.0.2.2"]' % address)
    machine.ask_sh("cp -p /etc/plumb/plumb.toml /run/plumb.toml && "
                   f"sed -i '/^\\[dicom\\]/a {lines}' /etc/plumb/plumb.toml && "
                   f"systemctl restart {unit}")
    until = time.monotonic() + 60 * Run.patience
    while (answer := echo(machine, "KNOWN")).returncode != 0:
        if time.monotonic() > until:
            fail(f"no answer to a C-ECHO: {answer.stderr} "
                 f"{machine.ask_sh(f'systemctl status {unit}; true')}")
        time.sleep(1)
    say("ok      plumb-dicomd answers a C-ECHO of a known sender")
    if echo(machine, "STRANGER").returncode == 0:
        fail("plumb-dicomd answers an unknown sender")
    say("ok      and none of another")
    process = show(machine, unit, "MainPID").split("=")[1]
    expect("its process has no rights, and its calls are filtered",
           r"^Uid: [1-9]\d* .*CapEff: 0{16} .*NoNewPrivs: 1 Seccomp: 2$",
           " ".join(machine.ask_sh(
               f"grep -E '^(Uid|CapEff|NoNewPrivs|Seccomp):' /proc/{process}/status").split()))
    expect("it has not failed", "^ActiveState=active NRestarts=0 SubState=running$",
           show(machine, unit, "ActiveState", "SubState", "NRestarts"))
    expect_said(machine, unit, "11112")
    machine.ask_sh(f"mv /run/plumb.toml /etc/plumb/plumb.toml && systemctl restart {unit}")
