# SPDX-License-Identifier: Apache-2.0
"""Answers of QEMU, which may end or stop at any time."""

import time


def receive(connection, until):
    """Some bytes of a socket. OSError if QEMU has closed it, or at `until` (time.monotonic())."""
    left_s = until - time.monotonic()
    if left_s <= 0:
        raise TimeoutError("no end of the answer within the limit")
    connection.settimeout(left_s)
    data = connection.recv(65536)
    if not data:
        raise OSError("QEMU has ended")
    return data
