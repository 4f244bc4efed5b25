#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# provision.py PLUMBD: toolchain/provision with twenty units of one table, again, and taken over by
# plumbd; and tables that are wrong.
import pathlib
import subprocess
import sys
import tempfile
import tomllib

PLUMBD = pathlib.Path(sys.argv[1]).resolve()
PROVISION = pathlib.Path(__file__).resolve().parents[2] / "toolchain" / "provision"
ZONES = "serial,time_zone\n"
HEADER = "serial,host_name,address,gateway,dns,time_servers,display\n"


def run(folder, table):
    (folder / "units.csv").write_text(table)
    return subprocess.run(
        [PROVISION, folder / "units.csv", folder / "out"], capture_output=True, text=True
    )


def files(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def check_taken_over(folder, count):
    """Each unit's plumbd takes over what the table says, and nothing of another one."""
    for n in range(1, count + 1):
        unit, state = folder / f"unit-{n}", folder / f"state-{n}"
        for made in (unit, state):
            made.mkdir()
        subprocess.run(
            [PLUMBD, "--provision", folder / "out" / f"PL-{n:04}" / "plumb-provision.toml",
             "--unit", unit, "--state", state],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        display = (state / "provisioned-display").read_text()
        settings = {name: data.decode().strip() for name, data in files(unit).items()}
        lines = settings["network"].splitlines() + settings["time-servers"].splitlines()
        found = (settings["serial"], settings["host-name"], display.strip()[-len(f" Room {n}"):],
                 f"Address=192.168.10.{n}/24" in lines, "NTP=ntp.example" in lines)  # fmt: skip
        expected = (f"PL-{n:04}", f"plumb-{n}", f" Room {n}", True, True)
        assert found == expected, f"unit {n}: expected {expected}, found {found}"


def check_twenty(folder):
    rows = [
        f"PL-{n:04},plumb-{n},192.168.10.{n}/24,192.168.10.254,192.168.10.1 192.168.10.2,"
        f"ntp.example,Room {n}\n"
        for n in range(1, 21)
    ]
    done = run(folder, HEADER + "".join(rows))
    assert done.returncode == 0, done.stderr
    made = files(folder / "out")
    assert len(made) == 40, made.keys()
    unit = tomllib.loads(made["PL-0007/plumb-provision.toml"].decode())
    assert unit == {
        "unit": {"serial": "PL-0007", "host_name": "plumb-7"},
        "network": {
            "address": "192.168.10.7/24",
            "gateway": "192.168.10.254",
            "dns": ["192.168.10.1", "192.168.10.2"],
            "time_servers": ["ntp.example"],
        },
        "display": {"name": "Room 7", "key_file": "display.key"},
    }, unit
    keys = {data for name, data in made.items() if name.endswith("display.key")}
    assert len(keys) == 20 and all(len(key) == 65 for key in keys)
    assert (folder / "out" / "PL-0007" / "display.key").stat().st_mode & 0o777 == 0o600
    assert run(folder, HEADER + "".join(rows)).returncode == 0
    assert files(folder / "out") == made, "a second run gives other files"
    check_taken_over(folder, 20)
    assert run(folder, ZONES + "Z,Europe/Berlin\n").returncode == 0
    unit = tomllib.loads((folder / "out" / "Z" / "plumb-provision.toml").read_text())
    assert unit == {"unit": {"serial": "Z", "time_zone": "Europe/Berlin"}}, unit


def check_wrong(folder):
    good = "A,a,10.0.0.1/8,,,,\n"
    for table, says in {
        ZONES + "A,Europe/Bielefeld\n": "row 1: time_zone: expected the name of a time zone",
        ZONES + "A,../zoneinfo/Etc/UTC\n": "row 1: time_zone",
        "": "expected one column 'serial'",
        HEADER: "no units",
        "serial,colour\nA,red\n": "unknown column 'colour'",
        HEADER + good + ",b,,,,,\n": "row 2: no serial",
        HEADER + good + "../x,b,,,,,\n": "row 2: serial",
        HEADER + good + 'B"\n,b,,,,,\n': "row 2",
        HEADER + good + "B,-b,,,,,\n": "row 2: host_name",
        HEADER + good + "B,b,10.0.0.2,,,,\n": "row 2: address",
        HEADER + good + "B,b,10.0.0.2/33,,,,\n": "row 2: address",
        HEADER + good + "B,b,10.0.0.1/24,,,,\n": "is also in row 1",
        HEADER + good + "a,b,,,,,\n": "is also in row 1",
        HEADER + good + "B,b,,10.0.0.3,,,\n": "without an address",
        HEADER + good + "B,b,10.0.0.2/8,,x,,\n": "row 2: dns",
        HEADER + good + "B,b,,,,,Room\u00e9\n": "row 2: display",
        HEADER + good + "B,b\n": "another number of cells",
    }.items():
        done = run(folder, table)
        assert done.returncode == 3, (table, done)
        assert says in done.stderr, (table, done.stderr)
        assert not (folder / "out").exists(), table


for check in (check_wrong, check_twenty):
    with tempfile.TemporaryDirectory() as name:
        check(pathlib.Path(name))
sys.exit(0)
