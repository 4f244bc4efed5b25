# SPDX-License-Identifier: Apache-2.0
"""For toolchain/test-image --from: a unit of the version before is updated to this one, goes back,
and is updated again. It makes scans of the virtual sensor by the programs of both versions."""

import glob
import json
import os
import re
import shutil
import socket
import subprocess
import time

from image_test.machine import PASSWORD, Machine, Page, Run, expect, fail, say
from image_test.services import check_gate, check_roll_back

PLUMB = 500  # the number of its account and group in every image
KEY = "a key of 0.2.0, which this version only reads"
PEOPLE = {"planner": "physicist", "approver": "physicist", "technician": "technician"}
# Of the version that is not fit for work: the self test of the gate needs this program. It waits,
# so that somebody can work with the version that will be left.
BROKEN = """#!/bin/sh
until [ -e /run/planted ]; do sleep 1; done
echo 'planted by the test' >&2
exit 1
"""
# For an emulated processor, which takes minutes for what others do in seconds.
SELF_TEST = """[Service]
Environment=PLUMB_GATE_WAIT=60 PLUMB_GATE_FRAMES=30
TimeoutStartSec=30min
"""
CONFIGURATION = """[storage]
backup_folder = "/var/lib/plumb-backup"
backup_key_file = "/etc/plumb/backup.key"
"""
KEPT = "scans sensor-profiles"  # folders of the state whose files no update changes
SCENES = ["--simulated", "demo", "--sim-size", "320x240", "--sim-frames", "120", "--sim-scenes",
          "2"]


def partition(disk, number):
    """A partition of a disk as debugfs takes it."""
    about = subprocess.run(
        ["sgdisk", "-i", str(number), disk], check=True, capture_output=True, text=True).stdout
    return f"{disk}?offset={512 * int(re.search(r'First sector: ([0-9]+)', about)[1])}"


def debugfs(device, commands):
    return subprocess.run(["debugfs", "-w", "-f", "/dev/stdin", device],
                          input="\n".join(commands) + "\n",
                          check=True, capture_output=True, text=True).stdout


class Files:
    """Files to be put into a file system that nothing uses, by debugfs."""

    def __init__(self, work):
        self.work, self.commands = work, []
        os.makedirs(work, exist_ok=True)

    def put(self, name, text, mode=0o644, owner=0, group=0):
        source = os.path.join(self.work, str(len(self.commands)))
        with open(source, "w") as file:
            file.write(text)
        folders = os.path.dirname(name).split("/")
        self.commands += [f"mkdir {'/'.join(folders[:i])}" for i in range(2, len(folders) + 1)]
        self.commands.append(f"rm {name}")
        self.copy(source, name, mode, owner, group)

    def copy(self, source, name, mode, owner, group):
        self.commands += [f"write {source} {name}", f"sif {name} mode 0{0o100000 | mode:o}",
                          f"sif {name} uid {owner}", f"sif {name} gid {group}"]

    def put_tree(self, tree, name, number):
        """What is in a folder, as belonging to the account of this number."""
        for folder, _, files in sorted(os.walk(tree)):
            inside = os.path.normpath(os.path.join(name, os.path.relpath(folder, tree)))
            if folder != tree:
                self.commands += [f"mkdir {inside}", f"sif {inside} mode 040700",
                                  f"sif {inside} uid {number}", f"sif {inside} gid {number}"]
            for file in files:
                source = os.path.join(folder, file)
                if os.path.isfile(source):
                    self.copy(source, os.path.join(inside, file),
                              os.stat(source).st_mode & 0o777, number, number)

    def write(self, device):
        debugfs(device, self.commands)
        shutil.rmtree(self.work)


def make_release(folder, work, name, old, broken):
    """A bundle of this version as release `name`, signed with the keys of the old image. Its gate
    makes the self test."""
    root = os.path.join(work, f"root-{name}.ext4")
    image = glob.glob(os.path.join(folder, "image", "root-*.ext4"))[0]
    subprocess.run(["cp", "--sparse=always", image, root], check=True)
    files = Files(os.path.join(work, "files"))
    files.put("/etc/plumb-release", f"{name} {'broken' if broken else 'made'} by a test\n")
    with open(os.path.join(old, "pki", "own-ca.pem")) as authority:
        files.put("/etc/rauc/ca.pem", authority.read())
    files.put("/etc/systemd/system/plumb-mark-good.service.d/emulated.conf", SELF_TEST)
    if broken:
        files.put("/usr/bin/plumb", BROKEN, mode=0o755)
    files.write(root)
    bundle = os.path.join(work, f"{name}.raucb")
    if os.path.exists(bundle):
        os.remove(bundle)
    toolchain = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    subprocess.run([os.path.join(toolchain, "bundle"), "--image", root, "--version", name,
                    "--cert", f"{old}/pki/own.pem", "--key", f"{old}/pki/own.key",
                    "--out", bundle], check=True, capture_output=True,
                   env={**os.environ, "PLUMB_MKSQUASHFS_ARGS": "-Xcompression-level 1"})
    os.remove(root)
    return bundle


class Unit:
    """plumbd of a version with its virtual sensor, out of its packages, on this machine."""

    def __init__(self, packages, work):
        self.process = None
        self.tree, self.folder = os.path.join(work, "programs"), os.path.join(work, "unit")
        for folder in (self.tree, self.folder):
            shutil.rmtree(folder, ignore_errors=True)
        for name in ("plumb", "plumbd", "plumb-virtual-sensor"):
            package = glob.glob(os.path.join(packages, f"{name}_*.deb"))[0]
            subprocess.run(["dpkg-deb", "-x", package, self.tree], check=True)
        self.state, self.backup = f"{self.folder}/state", f"{self.folder}/backup"
        self.control, self.log = f"{self.folder}/control", f"{self.folder}/log"
        for folder in (self.state, self.backup):
            os.makedirs(folder)
        os.chmod(self.folder, 0o700)
        with open(f"{self.folder}/backup.key", "w") as file:
            file.write(KEY + "\n")
        os.chmod(f"{self.folder}/backup.key", 0o600)
        with open(f"{self.folder}/plumb.toml", "w") as file:
            file.write(CONFIGURATION.replace("/var/lib/plumb-backup", self.backup)
                       .replace("/etc/plumb", self.folder))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

    def start(self):
        with open(self.log, "w") as log:
            self.process = subprocess.Popen(
                [f"{self.tree}/usr/bin/plumbd", "--config", f"{self.folder}/plumb.toml", "--state",
                 self.state, "--control", self.control, "--listen", f"127.0.0.1:{self.port}",
                 *SCENES], stdout=log, stderr=log)
        Page(self.port).wait_healthy(300)

    def setup_code(self):
        with open(self.log) as log:
            return re.search(r"setup code: (\S{4}-\S{4})", log.read())[1]

    def tell(self, *command):
        """By its own command line."""
        return subprocess.run([f"{self.tree}/usr/bin/plumb", "--control", self.control, *command],
                              check=True, capture_output=True, text=True).stdout.strip()

    def stop(self):
        self.process.terminate()
        if self.process.wait(60 * Run.patience) != 0:
            fail(f"plumbd ended with {self.process.returncode}")

    def kill(self):
        if self.process is not None and self.process.poll() is None:
            self.process.kill()


class People:
    """The page, for each person of the unit."""

    def __init__(self, port):
        self.port, self.pages = port, {}

    def visit(self):
        page = Page(self.port)
        page.wait_healthy(900)
        return page

    def log_in(self, name, password=PASSWORD):
        page = self.visit()
        page.log_in(name, password)
        self.pages[name] = page
        return page

    def log_in_all(self):
        for name in ["engineer", *PEOPLE]:
            self.log_in(name)
        say(f"ok      engineer, {', '.join(PEOPLE)} log in")

    def ask(self, name, method, path, body=None, status=range(200, 300)):
        found, answer = self.pages[name].ask(method, "/api/v1" + path, body, timeout=120)
        if found not in status:
            fail(f"{name} {method} {path} {body}: {found} {answer}")
        return answer


def wait_status(people, is_so, otherwise):
    until = time.monotonic() + 180 * Run.patience
    while time.monotonic() < until:
        status = people.ask("technician", "GET", "/status")
        if is_so(status):
            return
        time.sleep(0.2)
    fail(f"{otherwise}: {status}")


def scan(unit, people, patient, purpose):
    """The technician scans the patient; gives the scan's number."""
    people.ask("technician", "POST", f"/patients/{patient}/open",
               {"purpose": purpose, "reason": "planning" if purpose == "reference" else ""})
    people.ask("technician", "POST", "/scan/start")
    wait_status(people, lambda status: status["state"] == "scanning" and
                status["scan"]["frames"] + status["scan"]["frames_dropped"] >= 120,
                "the sweep does not end")
    people.ask("technician", "POST", "/scan/end")
    wait_status(people, lambda status: status["state"] == "result", "there is no result")
    number, verdict = [unit.tell("status", "--get", f"last_result.{key}")
                       for key in ("scan", "verdict")]
    say(f"ok      scan {number} ({purpose}): {verdict}")
    return number


def close_sessions(people):
    people.ask("technician", "POST", "/treatment/close", {"session_id": ""},
               status=[200, 201, 204, 409])


def approve(people, reference):
    plan = people.ask("planner", "GET", f"/references/{reference}")["plan"]
    tolerance = plan.pop("tolerance")
    plan |= {"shift_tolerance_mm": tolerance["shift_mm"],
             "rotation_tolerance_deg": tolerance["rotation_deg"], "revision": 1}
    people.ask("planner", "PUT", f"/references/{reference}/plan", plan)
    seen = people.ask("approver", "GET", f"/references/{reference}")
    people.ask("approver", "POST", f"/references/{reference}/approve",
               {"revision": seen["revision"], "digest": seen["digest"], "password": PASSWORD})


def make_people(people, code):
    expect("the first account of 0.2.0", "20[01]",
           people.visit().ask("POST", "/api/v1/setup",
                              {"code": code, "name": "engineer", "password": PASSWORD})[0])
    people.log_in("engineer")
    for name, role in PEOPLE.items():
        people.ask("engineer", "POST", "/users",
                   {"name": name, "role": role, "password": PASSWORD + " at first"})
        people.log_in(name, PASSWORD + " at first")
        people.ask(name, "POST", "/session/password",
                   {"old_password": PASSWORD + " at first", "password": PASSWORD})
    people.log_in_all()


def use_old_unit(unit):
    """Accounts, a patient, an approved plan, scans compared with it, a profile of the sensor, an
    encrypted backup. Gives what names them: patient, plan, scans."""
    unit.start()
    people = People(unit.port)
    make_people(people, unit.setup_code())
    wait_status(people, lambda status: status["state"] == "ready",
                "the virtual sensor is not ready")
    close_sessions(people)
    patient = people.ask("technician", "POST", "/patients",
                         {"code": "PX-17", "site": "thorax"})["id"]
    scan(unit, people, patient, "reference")
    plan = people.ask("technician", "GET", "/status")["waiting"][0]["reference_id"]
    approve(people, plan)
    say("ok      a plan is made by one person and approved by another")
    unit.tell("sim", "next-scene")
    scans = [scan(unit, people, patient, "fraction") for _ in range(2)]
    close_sessions(people)
    people.ask("engineer", "POST", "/backup")
    unit.stop()
    expect("0.2.0 has made an encrypted backup", "plumb", os.listdir(unit.backup))
    return patient, plan, scans


def accounted(machine, people, patient, plan, scans):
    """What a version before has made and no update may change: by the page, and each file."""
    ask = lambda path, name="planner": people.ask(name, "GET", path)
    pick = lambda row, *keys: {key: row[key] for key in keys}
    found = {
        "accounts": sorted((one["name"], one["role"])
                           for one in ask("/users", "engineer")["users"]),
        "patients": [pick(one, "id", "code", "site") for one in ask("/patients")["patients"]],
        "plan": pick(ask(f"/references/{plan}"), "id", "patient_id", "scan_id", "revision",
                     "planned_by", "approved_by", "approved_at", "plan"),
    }
    for number in scans:
        result = ask(f"/scans/{number}")["result"]
        found[f"scan {number}"] = pick(result, "verdict", "correction", "u95")
        if len(result["correction"]) != 6:
            fail(f"scan {number} has no six numbers: {result}")
    files = machine.ask_sh(
        f"cd /var/lib/plumb && find {KEPT} -type f -exec sha256sum {{}} +", 120).splitlines()
    return found, set(files)


def expect_accounted(machine, people, before, unit, what):
    """Everything of before is there; newer rows and files may be, too."""
    found, files = accounted(machine, people, *unit)
    for key, value in before[0].items():
        is_list = isinstance(value, list)
        if found[key] != value and not (is_list and all(one in found[key] for one in value)):
            fail(f"{what}: {key} was {value} and is {found[key]}")
    if missing := before[1] - files:
        fail(f"{what}: {len(missing)} files are not as they were: {sorted(missing)[:5]}")
    say(f"ok      {what}: {len(before[0])} kinds of rows and {len(before[1])} files as before")
    return found, files


def install(people, bundle):
    page = people.pages["engineer"]
    name = os.path.basename(bundle)
    status, answer = page.send(name, bundle)
    expect(f"{name} is taken", "20[01]", f"{status} {answer}")
    expect("and installed", "is installed", page.install(name))
    page.ask("DELETE", f"/api/v1/update/bundles/{name}")


def restart(machine, people):
    machine.read_from = os.path.getsize(machine.console)
    for _ in range(3):  # on a busy machine polkit may take longer to start than plumbd waits
        answer = people.ask("engineer", "POST", "/update/restart", {"password": PASSWORD},
                            status=[200, 500])
        if "timed out" not in str(answer):
            break
    machine.wait_console("Welcome to GRUB", 300)


def is_unit_of(machine, people, version, slot):
    people.log_in("engineer")
    expect("the system that runs", f"^{slot}$", people.ask("engineer", "GET", "/update")["slot"])
    expect("its plumbd", version, machine.ask_sh("plumbd --version | head -1"))


def fail_once(machine, people, bundle, unit, before):
    """The gate finds the new version unfit, and the old one goes on with its own data."""
    install(people, bundle)
    restart(machine, people)
    is_unit_of(machine, people, r"0\.3\.", "B")
    people.log_in_all()
    expect_accounted(machine, people, before, unit, "on trial")
    expect("the folder of received files, which 0.2.0 did not have, is on the data partition",
           " ext4 ", machine.ask_sh("grep ' /var/lib/plumb-dicom ' /proc/mounts"))
    expect("the database from before the conversion is kept", "plumb.db",
           machine.ask_sh("ls /var/lib/plumb/before-checksums"))
    people.ask("technician", "POST", "/patients", {"code": "LOST", "site": "thorax"})
    say("ok      on trial somebody adds a patient")
    machine.ask_sh("touch /run/planted")
    machine.wait_console("not marked good: the self test failed: planted by the test", 300)
    say("ok      the gate finds this version unfit")
    machine.wait_console("the database is the one from before the update", 60)
    say("ok      and puts the old database back")
    machine.wait_console("(?s)is not fit for work: restarting.*Welcome to GRUB", 300)
    is_unit_of(machine, people, r"0\.2\.0", "A")
    people.log_in_all()
    expect_accounted(machine, people, before, unit, "0.2.0 after the return")
    codes = [one["code"] for one in people.ask("planner", "GET", "/patients")["patients"]]
    if "LOST" in codes:
        fail(f"0.2.0 has rows of the newer version: {codes}")
    expect("the database that the newer version had converted was set aside", "plumb.db",
           machine.ask_sh("ls /var/lib/plumb/before-restore-1"))
    expect("the page of 0.2.0 says what has happened", ".",
           people.ask("planner", "GET", "/status")["rolled_back"])
    expect("and its log what was put back", "sha256 [0-9a-f]{64}",
           [one for one in people.ask("planner", "GET", "/audit")["entries"]
            if one["action"] == "backup.restore"])
    check_roll_back(machine)
    machine.wait_console("release 0.2.0 .* is marked good", 600)


def read_old_backup(machine, name, files):
    """By this version, from the disk on which 0.2.0 has left it under this name."""
    backup = f"/var/lib/plumb-backup/{name}"
    out, wrong = "/tmp/restored", "/tmp/wrong"
    machine.ask_sh(f"umask 077; echo the wrong key >{wrong}")
    said, code = machine.sh(f"plumb restore {backup} --key-file {wrong} --state {out}", 120)
    expect("with another key the backup of 0.2.0 is refused", "^3 .*another key than",
           f"{code} {said}")
    machine.ask_sh(f"plumb restore {backup} --key-file /etc/plumb/backup.key --state {out}", 300)
    restored = set(machine.ask_sh(
        f"cd {out} && find {KEPT} -type f -exec sha256sum {{}} +", 120).splitlines())
    if restored != files:
        fail(f"the backup has other files: {sorted(restored ^ files)[:5]}")
    say(f"ok      with its own it is read by this version: all {len(files)} files")
    machine.ask_sh(f"rm -rf {out} {wrong}")


def make_machine(old, folder, work, unit):
    """The image of 0.2.0 with what the unit has made and the test's shell of this version's image,
    and its backup on a disk for backups."""
    for name in ("architecture", "image"):
        link = os.path.join(work, name)
        if not os.path.lexists(link):
            os.symlink(os.path.join(old, name), link)
    machine = Machine(work, backup_mb=512)
    disk = os.path.join(work, "disk.img")
    system = Files(os.path.join(work, "files"))
    shell = "/etc/systemd/system/test-shell.service"
    root = glob.glob(os.path.join(folder, "image", "root-*.ext4"))[0]
    system.put(shell, subprocess.run(["debugfs", "-R", f"cat {shell}", root], check=True,
                                     capture_output=True, text=True).stdout)
    system.commands.append("symlink /etc/systemd/system/multi-user.target.wants/test-shell.service "
                           "../test-shell.service")
    system.write(partition(disk, 2))
    data = Files(os.path.join(work, "files"))
    data.put("/etc/plumb.toml", CONFIGURATION, mode=0o640, group=PLUMB)
    data.put("/etc/backup.key", KEY + "\n", mode=0o640, group=PLUMB)
    data.put_tree(unit.state, "/plumb", PLUMB)
    data.write(partition(disk, 4))
    kept = Files(os.path.join(work, "files"))
    kept.put_tree(unit.backup, "/", PLUMB)
    kept.write(os.path.join(work, "backup.img"))
    return machine


def update_from(old, folder, work):
    """`old`: where toolchain/test-image-make of 0.2.0 made image and keys, in its build folder with
    the packages; `folder`: the same of this version; `work`: for bundles and disks of this run."""
    old = os.path.abspath(old)
    os.makedirs(work, exist_ok=True)
    unit = Unit(os.path.join(os.path.dirname(old), "packages"), work)
    try:
        made = use_old_unit(unit)
    finally:
        unit.kill()
    broken = make_release(folder, work, "0.3.0", old, broken=True)
    good = make_release(folder, work, "0.3.1", old, broken=False)
    say(f"ok      two bundles of this version, signed with the keys in {old}")
    machine = make_machine(old, folder, work, unit)
    people = People(machine.port)
    try:
        machine.start()
        is_unit_of(machine, people, r"0\.2\.0", "A")
        people.log_in_all()
        before = accounted(machine, people, *made)
        say(f"        {json.dumps(before[0])}, {len(before[1])} files")
        machine.wait_console("release 0.2.0 .* is marked good", 600)
        fail_once(machine, people, broken, made, before)
        people.ask("technician", "POST", "/patients", {"code": "BETWEEN", "site": "pelvis"})
        before = accounted(machine, people, *made)[0], before[1]
        install(people, good)
        restart(machine, people)
        is_unit_of(machine, people, r"0\.3\.", "B")
        people.log_in_all()
        expect_accounted(machine, people, before, made, "after the second update")
        read_old_backup(machine, os.listdir(unit.backup)[0], before[1])
        machine.wait_console(r"release 0\.3\.1 .* is marked good", 900)
        say("ok      the gate with its self test finds this version fit")
        check_gate(machine)
        machine.stop()
    finally:
        machine.kill()
