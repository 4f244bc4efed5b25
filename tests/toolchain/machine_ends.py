#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# machine_ends.py: a QEMU that ends, or says no more, ends the run of toolchain/test-image with the
# cause. A socket of the test's own stands for QEMU.
import contextlib
import pathlib
import socket
import sys
import tempfile
import threading
import unittest.mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "toolchain"))
from image_test import version_before  # noqa: E402
from image_test.devices import GpioLines, UsbUnit  # noqa: E402
from image_test.machine import Machine, Run  # noqa: E402


@contextlib.contextmanager
def qemu(path, says, stays=False):
    """Takes one connection, says something, and ends when it is asked unless it `stays`: it then
    says something again and again."""
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path)
        server.listen()
        over = threading.Event()

        def serve():
            connection, _ = server.accept()
            with connection:
                if says:
                    connection.sendall(says)
                connection.recv(65536)
                with contextlib.suppress(OSError):  # the other end has closed it
                    while stays and not over.wait(0.05):
                        connection.sendall(b".")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def ends(what, ask, words):
    """In a thread, so that a wait without an end fails this test, too."""
    found = []

    def run():
        try:
            found.append(f"an answer: {ask()}")
        except (Exception, SystemExit) as error:
            found.append(f"{type(error).__name__}: {error}")

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(20)
    assert found, f"{what} waits without an end"
    assert words in found[0], f"{what}: {found[0]}"


def machine_in(folder):
    machine = Machine.__new__(Machine)
    machine.folder, machine.process = folder, unittest.mock.Mock()
    machine.process.poll.return_value = None
    return machine


def shell_of(folder, seconds):
    machine = machine_in(folder)
    machine.connect_shell()
    return lambda: machine.sh("true", seconds)


def gpio_of(folder):
    return lambda: GpioLines(f"{folder}/qtest", lambda command: "/x (pl061)").output(0)


def failing_program(folder):
    """plumbd of the version before cannot be started: that is what is raised."""
    with unittest.mock.patch.multiple(
        version_before,
        glob=unittest.mock.Mock(glob=lambda pattern: ["package"]),
        use_old_unit=unittest.mock.Mock(side_effect=FileNotFoundError("a missing library")),
    ), unittest.mock.patch.object(version_before.subprocess, "run"):
        version_before.update_from(folder, folder, f"{folder}/work")


def main():
    with tempfile.TemporaryDirectory() as folder:
        with qemu(f"{folder}/monitor", b"QEMU 7.2\n(qemu) "):
            ends("the monitor", lambda: machine_in(folder).monitor("info status"),
                 "OSError: QEMU has ended")
        with qemu(f"{folder}/shell", b"half an answer"):
            said = []
            with unittest.mock.patch("image_test.machine.say", said.append):
                ends("the shell", shell_of(folder, 60), "SystemExit")
            assert "QEMU has ended: half an answer" in said[0], said
        with qemu(f"{folder}/qtest", b""):
            ends("the GPIO lines", gpio_of(folder), "OSError: QEMU has ended")
        with qemu(f"{folder}/usb", b""):
            ends("the USB device", lambda: UsbUnit(f"{folder}/usb"), "EOFError")
        pathlib.Path(folder, "shell").unlink()
        Run.patience = 0.01
        with qemu(f"{folder}/shell", b"half an answer", stays=True):
            said = []
            with unittest.mock.patch("image_test.machine.say", said.append):
                ends("a shell that never comes to an end", shell_of(folder, 60), "SystemExit")
        Run.patience = 1.0
        ends("plumbd that cannot start", lambda: failing_program(folder),
             "FileNotFoundError: a missing library")


main()
