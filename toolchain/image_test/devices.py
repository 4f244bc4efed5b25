# SPDX-License-Identifier: Apache-2.0
"""Devices of the emulated machine for toolchain/test-image: a USB device and GPIO lines."""

import socket
import struct
import threading
import time

from image_test.sockets import receive


class UsbUnit:
    """A USB device with the identifiers of an Xtion Pro Live, connected to QEMU's usb-redir device.
    It has descriptors and three endpoints and refuses all other requests, so that a driver finds it
    but cannot open it. `path` is the socket of QEMU's chardev."""

    VENDOR, PRODUCT, VERSION = 0x1D27, 0x0601, 0x0001
    ENDPOINTS = {0x81: 1, 0x82: 1, 0x83: 2}  # address: type (1 isochronous, 2 bulk)
    HELLO, CONNECT, DISCONNECT, INTERFACES, ENDPOINT_LIST = 0, 1, 2, 4, 5
    SET_CONFIGURATION, GET_CONFIGURATION, CONFIGURATION = 6, 7, 8
    SET_ALTERNATIVE, GET_ALTERNATIVE, ALTERNATIVE, CONTROL = 9, 10, 11, 100
    # Version in CONNECT, sizes in ENDPOINT_LIST, identifiers of 64 bits, bulk lengths of 32 bits.
    CAPABILITIES = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6
    STALL = 4

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(30)  # until QEMU has answered
        self.socket.connect(path)
        self.asked = []  # control requests from the guest: (type, request, value)
        self.configuration = 0
        # The first packet of each side has a short identifier; its capabilities decide the length
        # of those that follow.
        self.socket.sendall(
            struct.pack("<III64sI", self.HELLO, 68, 0, b"plumb test", self.CAPABILITIES))
        kind, length, _ = struct.unpack("<III", self._receive(12))
        self._receive(length)
        if kind != self.HELLO:
            raise RuntimeError(f"QEMU's USB redirection begins with {kind}, expected hello")
        self.socket.settimeout(None)
        threading.Thread(target=self._serve, daemon=True).start()

    def plug(self):
        self._send(self.INTERFACES, struct.pack("<I32s32s32s32s", 1, b"", b"\xff" * 1, b"", b""))
        kinds, intervals, sizes = bytearray(b"\xff" * 32), bytearray(32), [0] * 32
        kinds[0] = kinds[16] = 0
        for address, kind in self.ENDPOINTS.items():
            place = 16 + (address & 15)
            kinds[place], intervals[place], sizes[place] = kind, 1, 512
        sizes[0] = sizes[16] = 64
        self._send(self.ENDPOINT_LIST,
                   bytes(kinds + intervals) + bytes(32) + struct.pack("<32H", *sizes))
        self._send(self.CONNECT, struct.pack("<4B3H", 2, 0, 0, 0,  # 2: 480 Mbit/s
                                             self.VENDOR, self.PRODUCT, self.VERSION))

    def unplug(self):
        self.configuration = 0
        self._send(self.DISCONNECT, b"")

    def _receive(self, length):
        data = b""
        while len(data) < length:
            more = self.socket.recv(length - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def _send(self, kind, payload, identifier=0):
        self.socket.sendall(struct.pack("<IIQ", kind, len(payload), identifier) + payload)

    def _serve(self):
        try:
            while True:
                kind, length, identifier = struct.unpack("<IIQ", self._receive(16))
                self._answer(kind, self._receive(length), identifier)
        except (EOFError, OSError):
            pass  # the machine is off

    def _answer(self, kind, payload, identifier):
        if kind == self.CONTROL:
            self._control(payload, identifier)
        elif kind in (self.SET_CONFIGURATION, self.GET_CONFIGURATION):
            if kind == self.SET_CONFIGURATION:
                self.configuration = payload[0]
            self._send(self.CONFIGURATION, bytes([0, self.configuration]), identifier)
        elif kind in (self.SET_ALTERNATIVE, self.GET_ALTERNATIVE):
            self._send(self.ALTERNATIVE, bytes([0, payload[0], 0]), identifier)

    def _control(self, payload, identifier):
        endpoint, request, kind, _, value, index, length = struct.unpack("<4B3H", payload[:10])
        self.asked.append((kind, request, value))
        data = self._descriptor(value >> 8, value & 255) if (kind, request) == (0x80, 6) else None
        status = 0 if data is not None else self.STALL
        data = (data or b"")[:length]
        self._send(self.CONTROL, struct.pack("<4B3H", endpoint, request, kind, status, value, index,
                                             len(data)) + data, identifier)

    def _descriptor(self, kind, index):
        if kind == 1:
            return struct.pack("<BBH4B3H4B", 18, 1, 0x0200, 0, 0, 0, 64,
                               self.VENDOR, self.PRODUCT, self.VERSION, 1, 2, 0, 1)
        if kind == 2:
            endpoints = b"".join(struct.pack("<4BHB", 7, 5, address, type_, 512, 1)
                                 for address, type_ in self.ENDPOINTS.items())
            interface = struct.pack("<9B", 9, 4, 0, 0, len(self.ENDPOINTS), 255, 0, 0, 0)
            return struct.pack("<BBH5B", 9, 2, 9 + len(interface + endpoints),
                               1, 1, 0, 0x80, 250) + interface + endpoints
        if kind == 3:
            text = "\u0409" if index == 0 else ("PrimeSense", "PrimeSense Device")[index == 2]
            return bytes([2 + 2 * len(text), 3]) + text.encode("utf-16-le")
        return None


class GpioLines:
    """The lines of the GPIO controller (PL061) of QEMU's arm64 machine: sets inputs and reads
    outputs through QEMU's test interface."""

    REGISTERS = 0x09030000
    DATA, DIRECTION = 0x3FC, 0x400

    def __init__(self, path, monitor):
        """`monitor`: a function that sends a command to QEMU's monitor and returns the answer."""
        found = [line.strip().split(" ")[0].lstrip("/")
                 for line in monitor("info qom-tree /machine/unattached").splitlines()
                 if "(pl061)" in line]
        if len(found) != 1:
            raise RuntimeError(f"expected one pl061 in the machine, found {found}")
        self.device = "/machine/unattached/" + found[0]
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(30)
        self.socket.connect(path)

    def set(self, line, level):
        self._ask(f"set_irq_in {self.device} unnamed-gpio-in {line} {level}")

    def press(self, line, seconds):
        self.set(line, 1)
        time.sleep(seconds)
        self.set(line, 0)

    def output(self, line):
        """The level of an output of the guest; None if the line is not an output."""
        direction, data = (int(self._ask(f"readl {self.REGISTERS + at:#x}").split()[1], 16)
                           for at in (self.DIRECTION, self.DATA))
        return (data >> line) & 1 if (direction >> line) & 1 else None

    def _ask(self, command):
        until = time.monotonic() + 30
        self.socket.sendall(command.encode() + b"\n")
        answer = b""
        while not answer.endswith(b"\n"):
            answer += receive(self.socket, until)
        answer = answer.decode().strip().splitlines()[-1]
        if not answer.startswith("OK"):
            raise RuntimeError(f"QEMU's test interface, asked '{command}', answers '{answer}'")
        return answer
