# SPDX-License-Identifier: Apache-2.0
"""The machine of toolchain/test-image: QEMU with a disk, its page over HTTP, lines of the log."""

import glob
import http.cookiejar
import json
import os
import platform
import re
import shutil
import socket
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request

from image_test.sockets import receive

PASSWORD = "correct horse battery 7"
BEGIN = time.monotonic()
LARGER_MB = 600  # by which the disk is larger than the image


class Run:
    """Of this run: how many times as long each limit is, and the file for the lines, if any."""
    patience = 1.0
    log = None


def say(text):
    line = f"{time.monotonic() - BEGIN:7.1f} s  {text}"
    print(line, flush=True)
    if Run.log is not None:
        print(line, file=Run.log, flush=True)


def fail(text):
    say("FAILED  " + text)
    sys.exit(1)


FIRMWARE = {False: ("/usr/share/OVMF/OVMF_CODE_4M.fd", "/usr/share/OVMF/OVMF_VARS_4M.fd"),
            True: ("/usr/share/AAVMF/AAVMF_CODE.fd", "/usr/share/AAVMF/AAVMF_VARS.fd")}
# noreboot=off: QEMU before 8.0 otherwise has the chipset's watchdog switched off.
PROGRAM = {False: ["qemu-system-x86_64", "-M", "q35", "-cpu", "max",
                   "-global", "ICH9-LPC.noreboot=off"],
           True: ["qemu-system-aarch64", "-M", "virt,acpi=off", "-cpu", "cortex-a72"]}

# QEMU keeps its translations of the guest's code when the guest restarts, and each store into a
# page goes through all translations of that page. After several restarts the firmware's timer
# interrupt took longer than its period, so that nothing else ran. A small buffer is flushed often.
EMULATED = ["-accel", "tcg,tb-size=128"]
KVM = ["-accel", "kvm"]


class Machine:
    """QEMU with the disk; its serial console is a file that is read as it grows. `folder` is where
    toolchain/test-image-make made the image; `backup_mb`: a second disk, for backups."""

    def __init__(self, folder, memory_mb=1024, backup_mb=0):
        self.folder, self.memory_mb, self.process = folder, memory_mb, None
        with open(os.path.join(folder, "architecture")) as file:
            self.arm64 = file.read().strip() == "arm64"
        self.firmware, variables = FIRMWARE[self.arm64]
        native = platform.machine() == ("aarch64" if self.arm64 else "x86_64")
        self.accelerator = (KVM if native and os.access("/dev/kvm", os.R_OK | os.W_OK)
                            else EMULATED)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
            with socket.socket() as another:
                another.bind(("127.0.0.1", 0))
                self.dicom_port = another.getsockname()[1]
        self.console = os.path.join(folder, "console")
        shutil.copy(variables, os.path.join(folder, "vars.fd"))
        open(self.console, "w").close()
        image = glob.glob(os.path.join(folder, "image", "disk-*.img"))[0]
        disk = os.path.join(folder, "disk.img")
        subprocess.run(["cp", "--sparse=always", image, disk], check=True)
        os.truncate(disk, os.path.getsize(disk) + (LARGER_MB << 20))
        self.backup_disk = []
        if backup_mb:
            backup = os.path.join(folder, "backup.img")
            with open(backup, "wb") as file:
                file.truncate(backup_mb << 20)
            subprocess.run(["mkfs.ext4", "-q", "-L", "plumb-backup", backup], check=True)
            self.backup_disk = ["-drive", f"if=none,id=d1,format=raw,file={backup},cache=unsafe",
                                "-device", "virtio-blk-pci,drive=d1"]

    def start(self):
        """With KVM if it can run the firmware: inside another virtual machine it may not."""
        self.read_from = os.path.getsize(self.console)
        self.launch()
        if self.accelerator is KVM and not self.runs():
            say("        KVM does not run the firmware here: the processor is emulated")
            self.kill()
            self.accelerator = EMULATED
            self.launch()

    def runs(self):
        """Whether the firmware says something, before QEMU ends or stops the machine."""
        until = time.monotonic() + 60 * Run.patience
        while self.process.poll() is None and time.monotonic() < until:
            if self.seen():
                return True
            try:
                if "internal-error" in self.monitor("info status"):
                    return False
            except OSError:
                pass  # it has no monitor yet
            time.sleep(0.2)
        return False

    def launch(self):
        if os.path.exists(f"{self.folder}/shell"):
            os.remove(f"{self.folder}/shell")
        self.process = subprocess.Popen(
            PROGRAM[self.arm64] +
            self.accelerator + self.backup_disk +
            ["-smp", "1", "-m", str(self.memory_mb), "-display", "none",
             "-chardev", f"file,id=serial,path={self.console},append=on",
             "-serial", "chardev:serial", "-monitor", f"unix:{self.folder}/monitor,server,nowait",
             "-drive", f"if=pflash,format=raw,readonly=on,file={self.firmware}",
             "-drive", f"if=pflash,format=raw,file={self.folder}/vars.fd",
             "-drive", f"if=none,id=d0,format=raw,file={self.folder}/disk.img,cache=unsafe",
             "-device", "virtio-blk-pci,drive=d0,bootindex=0",
             "-netdev", f"user,id=n0,hostfwd=tcp:127.0.0.1:{self.port}-:8080,"
             f"hostfwd=tcp:127.0.0.1:{self.dicom_port}-:11112",
             "-device", "virtio-serial-pci",
             "-chardev", f"socket,id=shell,path={self.folder}/shell,server=on,wait=off",
             "-device", "virtserialport,chardev=shell,name=plumb.test",
             "-device", "virtio-net-pci,netdev=n0,romfile=",
             "-device", "virtio-rng-pci", "-device", "qemu-xhci",
             "-chardev", f"socket,id=usb,path={self.folder}/usb,server=on,wait=off",
             "-device", "usb-redir,chardev=usb",
             "-qtest", f"unix:{self.folder}/qtest,server=on,wait=off", "-qtest-log", "none"],
            stderr=subprocess.DEVNULL if self.accelerator is KVM else None)
        self.connect_shell()

    def seen(self):
        """What the console has shown since the start."""
        with open(self.console, errors="replace") as file:
            file.seek(self.read_from)
            return file.read()

    def wait_console(self, pattern, seconds):
        seconds *= Run.patience
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if found := re.search(pattern, self.seen()):
                return found
            if self.process.poll() is not None:
                fail(f"QEMU ended while '{pattern}' was awaited")
            time.sleep(0.5)
        fail(f"the console does not show '{pattern}' within {seconds} s; "
             f"its end: {self.seen()[-1500:]}")

    def monitor(self, command):
        """What QEMU's monitor answers."""
        with socket.socket(socket.AF_UNIX) as monitor:
            until = time.monotonic() + 30 * Run.patience
            monitor.settimeout(30 * Run.patience)
            monitor.connect(f"{self.folder}/monitor")
            answer = b""
            for ask in (b"", command.encode() + b"\n"):
                monitor.sendall(ask)
                answer = b""
                while not answer.endswith(b"(qemu) "):
                    answer += receive(monitor, until)
            return answer.decode(errors="replace")

    def connect_shell(self):
        """Before the guest runs: it drops what came before its shell had this connection."""
        self.shell = socket.socket(socket.AF_UNIX)
        until = time.monotonic() + 30 * Run.patience
        while self.shell.connect_ex(f"{self.folder}/shell") != 0:
            if time.monotonic() > until or self.process.poll() is not None:
                fail("QEMU has no line for the guest's shell")
            time.sleep(0.05)

    def sh(self, command, seconds=60):
        """What a command prints that root runs in the guest, by the shell that
        toolchain/test-image-make adds to the image, and its exit code."""
        end = f"end-{time.monotonic_ns()}"
        until = time.monotonic() + seconds * Run.patience
        self.shell.settimeout(seconds * Run.patience)
        answer = b""
        try:
            self.shell.sendall(f"{{ {command}\n}} 2>&1 </dev/null; code=$?; echo; "
                               f"echo {end} $code\n".encode())
            while not (found := re.search(rf"(?s)(.*)\n{end} (\d+)\n",
                                          answer.decode(errors="replace"))):
                answer += receive(self.shell, until)
        except OSError as error:
            fail(f"the guest's shell does not answer '{command}': {error}: "
                 f"{answer.decode(errors='replace')}")
        return found[1].rstrip("\n"), int(found[2])

    def ask_sh(self, command, seconds=60):
        """The same, where anything but success is a failure of the test."""
        answer, code = self.sh(command, seconds)
        if code != 0:
            fail(f"in the guest '{command}' ended with {code}: {answer}")
        return answer

    def plug_stick(self, files):
        """A USB stick with these files, as sticks are sold: one partition, with FAT32."""
        stick = os.path.join(self.folder, "stick.img")
        with open(stick, "wb") as image:
            image.truncate(64 << 20)
        for command in (["sgdisk", "-o", "-n", "1:2048:0", "-t", "1:0700", "-m", "1", stick],
                        ["mkfs.vfat", "-F", "32", "--offset", "2048", stick],
                        ["mcopy", "-i", f"{stick}@@1M", *files, "::"]):
            subprocess.run(command, check=True, capture_output=True)
        answers = [self.monitor(command) for command in (
            f"drive_add 0 if=none,id=stick,format=raw,readonly=on,file={stick}",
            "device_add usb-storage,drive=stick,id=stick,removable=on", "info usb")]
        if "ID: stick" not in answers[-1]:
            fail(f"QEMU has no USB stick: {answers}")

    def unplug_stick(self):
        self.monitor("device_del stick")

    def stop(self):
        """As the power button: the system shuts down by itself."""
        self.monitor("system_powerdown")
        try:
            self.process.wait(240 * Run.patience)
        except subprocess.TimeoutExpired:
            fail("the system does not shut down: " + self.seen()[-800:])

    def kill(self):
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()


class Page:
    """The page's HTTP interface, with or without TLS."""

    def __init__(self, port):
        self.port, self.scheme, self.token = port, None, None
        context = ssl._create_unverified_context()
        self.opener = urllib.request.build_opener(
            urllib.request.HTTPSHandler(context=context),
            urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar(
                policy=http.cookiejar.DefaultCookiePolicy(secure_protocols=("https", "http")))))

    def ask(self, method, path, body=None, file=None, timeout=60):
        headers = {}
        if self.token:
            headers["X-CSRF-Token"] = self.token
        data = None
        if body is not None:
            data, headers["Content-Type"] = json.dumps(body).encode(), "application/json"
        if file is not None:
            data, headers["Content-Type"] = open(file, "rb"), "application/octet-stream"
            headers["Content-Length"] = str(os.path.getsize(file))
        request = urllib.request.Request(
            f"{self.scheme}://127.0.0.1:{self.port}{path}", data, headers, method=method)
        try:
            with self.opener.open(request, timeout=timeout * Run.patience) as answer:
                text = answer.read().decode()
                return answer.status, json.loads(text) if text.startswith(("{", "[")) else text
        except urllib.error.HTTPError as error:
            text = error.read().decode(errors="replace")
            return error.code, json.loads(text) if text.startswith("{") else text

    def wait_healthy(self, seconds):
        seconds *= Run.patience
        until, last = time.monotonic() + seconds, None
        while time.monotonic() < until:
            for scheme in ("https", "http"):
                self.scheme = scheme
                try:
                    last = self.ask("GET", "/health", timeout=10)
                    if last[0] == 200:
                        return
                    break
                except (OSError, ValueError) as error:
                    last = error
            time.sleep(1)
        fail(f"the page is not healthy within {seconds} s: {last}")

    def log_in(self, name="engineer", password=PASSWORD):
        self.token = None
        status, answer = self.ask("POST", "/api/v1/login", {"name": name, "password": password})
        if status != 200:
            fail(f"login: {status} {answer}")
        status, answer = self.ask("GET", "/api/v1/session")
        self.token = answer["csrf_token"]

    def send(self, name, file):
        return self.ask("POST", f"/api/v1/update/bundles/{name}", file=file, timeout=900)

    def install(self, name, stop=lambda update, seconds: False, from_stick=False):
        """Gives the sentence at the end of it; or None once `stop`, which is asked every half
        second, returns true."""
        begin = time.monotonic()
        status, answer = self.ask("POST", "/api/v1/update",
                                  {"bundle": name, "from_stick": from_stick}, timeout=120)
        if status >= 300:
            return (answer["error"] if isinstance(answer, dict) and "error" in answer
                    else str(answer))
        shown = -1
        while True:
            update = self.ask("GET", "/api/v1/update")[1]
            if not update["installing"]:
                return update["message"]
            if stop(update, time.monotonic() - begin):
                return None
            if time.monotonic() - begin > 3600 * Run.patience:
                fail(f"the installation does not end: {update}")
            if int(10 * update["fraction"]) != shown:
                shown = int(10 * update["fraction"])
                say(f"        {100 * update['fraction']:.0f} % {update['message']}")
            time.sleep(0.5)


def expect(what, pattern, found):
    if not re.search(pattern, str(found)):
        fail(f"{what}: expected {pattern}, found {found}")
    say(f"ok      {what}: {found}")
