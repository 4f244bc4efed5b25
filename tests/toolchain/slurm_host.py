#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A Slurm cluster of two nodes on this host, for tests by hand: each node has a network and a host
name of its own, and one processor. Needs root, and Debian's slurmctld, slurmd, slurm-client and
munge.

  with SlurmHost(folder) as slurm:
      subprocess.run(["sbatch", ...], env=slurm.environment)
"""
import os
import pathlib
import subprocess
import time

BRIDGE = "plumbslurm"
NETWORK = "10.77.0"
NODES = ("plumbnode1", "plumbnode2")
LONGEST_WAIT_S = 60

SLURM_CONF = """
ClusterName=plumb
SlurmctldHost={host}({network}.254)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={munge}/socket
CredType=cred/munge
StateSaveLocation={folder}/slurm/state
SlurmdSpoolDir={folder}/slurm/%n
SlurmctldPidFile={folder}/slurm/slurmctld.pid
SlurmdPidFile={folder}/slurm/%n.pid
SlurmctldLogFile={folder}/slurm/slurmctld.log
SlurmdLogFile={folder}/slurm/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,defer
MinJobAge=60
SwitchType=switch/none
MailProg=/bin/true
SlurmdParameters=config_overrides
MpiDefault=none
ReturnToService=2
NodeName={nodes[0]} NodeAddr={network}.1 CPUs=1 RealMemory=4000
NodeName={nodes[1]} NodeAddr={network}.2 CPUs=1 RealMemory=4000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def call(*command):
    subprocess.run(command, check=True)


class SlurmHost:
    """The cluster, while it is entered. `environment` is for programs that talk to it."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.munge = self.folder / "munge"
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf")}
        self._processes = []

    def __enter__(self):
        try:
            self._start()
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(self, *_):
        self._stop()

    def _start(self):
        self._take_down()
        (self.folder / "slurm" / "state").mkdir(parents=True)
        self.munge.mkdir()
        (self.munge / "key").write_bytes(os.urandom(1024))
        (self.munge / "key").chmod(0o400)
        host = os.uname().nodename
        (self.folder / "slurm.conf").write_text(SLURM_CONF.format(
            host=host, network=NETWORK, munge=self.munge, folder=self.folder, nodes=NODES))
        call("ip", "link", "add", BRIDGE, "type", "bridge")
        call("ip", "address", "add", f"{NETWORK}.254/24", "dev", BRIDGE)
        call("ip", "link", "set", BRIDGE, "up")
        self._run("munged", "--foreground", "--force", f"--key-file={self.munge}/key",
                  f"--socket={self.munge}/socket", f"--pid-file={self.munge}/pid",
                  f"--log-file={self.munge}/log", f"--seed-file={self.munge}/seed")
        self._wait_for((self.munge / "socket").exists, "munged")
        self._run("slurmctld", "-D", "-f", self.folder / "slurm.conf")
        for number, node in enumerate(NODES, 1):
            call("ip", "netns", "add", node)
            call("ip", "link", "add", node, "type", "veth", "peer", "name", "eth0", "netns", node)
            call("ip", "link", "set", node, "master", BRIDGE, "up")
            for command in (("address", "add", f"{NETWORK}.{number}/24", "dev", "eth0"),
                            ("link", "set", "eth0", "up"), ("link", "set", "lo", "up")):
                call("ip", "-n", node, *command)
            # Not by `ip netns exec`, which hides /sys/fs/cgroup from slurmd.
            self._run("nsenter", f"--net=/run/netns/{node}", "unshare", "--uts", "sh", "-c",
                      f"hostname {node} && exec slurmd -D -f {self.folder}/slurm.conf")
        self._wait_for(self._are_idle, "the nodes")

    def _are_idle(self):
        states = subprocess.run(["sinfo", "--noheader", "--format=%T %D"], text=True,
                                capture_output=True, env=self.environment, check=False).stdout
        return states.split() == ["idle", str(len(NODES))]

    def _wait_for(self, is_there, what):
        end = time.monotonic() + LONGEST_WAIT_S
        while not is_there():
            if time.monotonic() > end:
                raise RuntimeError(f"{what} did not start; see {self.folder}/slurm")
            time.sleep(0.1)

    def _run(self, *command):
        with open(self.folder / "slurm.log", "a") as log:
            self._processes.append(subprocess.Popen(
                command, env=self.environment, stdout=log, stderr=log, start_new_session=True))

    def _stop(self):
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            process.wait()
        self._take_down()

    @staticmethod
    def _take_down():
        """What is there of the network, also of a run that was killed."""
        for kind, names in (("netns", NODES), ("link", (*NODES, BRIDGE))):
            for name in names:
                subprocess.run(["ip", kind, "delete", name], stderr=subprocess.DEVNULL, check=False)
