#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The boot menu of the image in GRUB's own interpreter (grub-emu): which system is started in every
state of the boot counter, and what is counted.

Exit code 77: left out, and the last line says why."""

import itertools
import os
import re
import shutil
import subprocess
import sys
import tempfile

MENU = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../toolchain/image.grub.cfg")
MOST_STARTS = 3


def left_out():
    print("skipped: grub-emu is missing: run toolchain/install")
    sys.exit(77 if os.environ.get("PLUMB_REQUIRE_ALL", "0") in ("", "0") else 1)


def run(menu):
    """What GRUB shows. It needs a terminal, which `script` gives it."""
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "grub.cfg"), "w") as file:
            file.write(menu)
        command = ["script", "-qec", f"env TERM=xterm grub-emu -d {folder}", "/dev/null"]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              check=True, timeout=50).stdout


def expected(whole, starts, order):
    """The system that is started, and the starts that are counted then."""
    starts = dict(starts)
    for again in (False, True):
        if again:
            starts = dict.fromkeys(starts, 0)
        for slot in order.split():
            if whole[slot] and starts[slot] < MOST_STARTS:
                starts[slot] += 1
                return slot, starts
    return "A", starts


def check_counter(text):
    defaults, rest = text.split("load_env --file ($root)/unitenv MACHINE_ID\n")
    defaults = defaults.replace("load_env --file ($root)/grubenv\n", "")
    decision = rest.split("save_env")[0]
    states = list(itertools.product((0, 1), range(4), (0, 1), range(4), ("A B", "B A")))
    menu = ""
    for a_ok, a_try, b_ok, b_try, order in states:
        menu += defaults + f"set A_OK={a_ok}\nset A_TRY={a_try}\n"
        menu += f"set B_OK={b_ok}\nset B_TRY={b_try}\n"
        menu += f'set ORDER="{order}"\n{decision}echo "CHOSEN $default $fallback $A_TRY $B_TRY"\n'
    found = re.findall(r"CHOSEN (\d) (\d) (\d) (\d)", run(menu + "exit\n"))
    faults = 0 if len(found) == len(states) else 1
    for (a_ok, a_try, b_ok, b_try, order), shown in zip(states, found):
        slot, starts = expected({"A": a_ok, "B": b_ok}, {"A": a_try, "B": b_try}, order)
        wanted = (slot == "B", slot == "A", starts["A"], starts["B"])
        if tuple(map(int, shown)) != wanted:
            faults += 1
            print(f"        A_OK={a_ok} A_TRY={a_try} B_OK={b_ok} B_TRY={b_try} ORDER={order}: "
                  f"expected {tuple(map(int, wanted))}, found {shown}")
    return faults, f"{len(found)} of {len(states)} states of the boot counter"


def check_machine_id(text):
    command = text[text.index("set CMD="):text.index("menuentry")]
    command += 'echo "LINE $CMD"\n'
    shown = run("set MACHINE_ID=\n" + command + "set MACHINE_ID=12ab\n" + command + "exit\n")
    lines = re.sub(r"[\r\n]", "", shown).split("LINE ")[1:]  # the terminal breaks long ones
    found = [re.findall(r"systemd\.machine_id=\w*", line) for line in lines]
    return found != [[], ["systemd.machine_id=12ab"]], f"machine ID for the kernel: {found}"


def check_fallback(text):
    """A system that cannot be loaded: these partitions do not exist."""
    title = 'menuentry "System A" {'
    menu = text[text.index(title):].replace(title, title + ' echo "IS RUN"; exit; ')
    shown = run("set timeout=0\nset default=1\nset fallback=0\n" + menu)
    return "IS RUN" not in shown, "a system that cannot be loaded makes room for the other"


def main():
    if not shutil.which("grub-emu"):
        left_out()
    with open(MENU) as file:
        text = file.read()
    failed = False
    for check in (check_counter, check_machine_id, check_fallback):
        fault, name = check(text)
        failed |= bool(fault)
        print(f"{'FAILED' if fault else 'ok    '}  {name}")
    return failed


sys.exit(main())
