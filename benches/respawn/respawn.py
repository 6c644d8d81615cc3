"""Time from kill -9 to ready: hilare's controller, without a standby, and a program under supervisord.

hilare's controller is ready when it has opened its wires, is connected to the others and has asked the
kernel for real time; its launch says when (`is back after`), and the log's time is CLOCK_MONOTONIC. The
program under supervisord is `sh`, ready with its first line. Both are killed in turn. Nothing is trimmed.

A death is known no earlier than the kernel has taken the process's memory apart: beside launch's figure
stands that of a bare poll of the same process's pidfd. Files of both are where $XDG_RUNTIME_DIR is on a machine
with systemd, in memory; `--directory /tmp` shows what a disk costs.
"""

import argparse
import json
import os
import random
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HILARE = Path("target/release/hilare").resolve()
KILLS_A_ROUND = 5


class Hilare:
    def __init__(self, directory):
        self.name, self.log = f"respawn{os.getpid()}", directory / "hilare.log"
        self.env = dict(os.environ, HILARE_RUNTIME_DIR=str(directory / "rt"))
        path = directory / "path.csv"
        path.write_text("x,y\n0,0\n100,0\n")
        self.say("up", "epuck", "--detach", "--log", str(self.log), "--set", "supervision.restart_budget=10000")
        self.say("follow", str(path))
        self.say("arm")
        self.read = 0

    def say(self, *args):
        command = [HILARE, *args, "--robot", self.name]
        return subprocess.run(command, env=self.env, capture_output=True, text=True, check=True).stdout

    def news(self):
        """What the log says since it was asked last."""
        with self.log.open() as file:
            file.seek(self.read)
            text = file.read()
            self.read = file.tell()
        return text

    def kill(self):
        """Milliseconds to what the kernel says, to launch's knowing, and to ready."""
        status = json.loads(self.say("status", "--json"))
        pid = next(process["pid"] for process in status["processes"] if process["authority"])
        self.news()
        pidfd = os.pidfd_open(pid)
        killed = time.clock_gettime(time.CLOCK_MONOTONIC)
        os.kill(pid, signal.SIGKILL)
        select.select([pidfd], [], [])
        gone = time.clock_gettime(time.CLOCK_MONOTONIC) - killed
        os.close(pidfd)
        text = ""
        while not (back := re.search(r"controller .* is back after ([\d.]+) ms", text)):
            time.sleep(0.005)
            text += self.news()
        known = float(re.search(r"^\s*([\d.]+) WARN .*starting it again", text, re.M).group(1)) - killed
        return 1e3 * gone, 1e3 * known, 1e3 * known + float(back.group(1))


class Supervised:
    def __init__(self, directory):
        self.started = directory / "started"
        self.started.touch()
        config = directory / "supervisord.conf"
        config.write_text(
            f"[supervisord]\nnodaemon=true\nlogfile={directory}/log\npidfile={directory}/pid\n"
            "[program:peer]\nautorestart=true\nstartsecs=0\nstartretries=1000000\n"
            f"command=/bin/sh -c 'echo $$ >> {self.started}; exec sleep 100000'\n"
        )
        program = Path(sys.executable).with_name("supervisord")
        self.process = subprocess.Popen([program, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.await_start(0)

    def await_start(self, before):
        while (size := self.started.stat().st_size) == before:
            time.sleep(0.0002)
        return size

    def kill(self):
        """Milliseconds to ready."""
        pid = int(self.started.read_text().split()[-1])
        size = self.started.stat().st_size
        killed = time.monotonic()
        os.kill(pid, signal.SIGKILL)
        self.await_start(size)
        return 1e3 * (time.monotonic() - killed)


def figures(name, values):
    ordered = sorted(values)
    at = lambda share: ordered[min(len(ordered) - 1, int(share * len(ordered)))]
    row = [at(0.5), at(0.99), ordered[-1]]
    print(f"{name:42}{len(ordered):6}" + "".join(f"{value:10.2f}" for value in row))
    return row


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--directory", default="/dev/shm", help="where the files of both are")
    args = parser.parse_args()
    gone, known, ours, peer = [], [], [], []
    with tempfile.TemporaryDirectory(prefix="hilare-respawn", dir=args.directory) as directory:
        hilare, supervised = Hilare(Path(directory)), Supervised(Path(directory))
        try:
            time.sleep(1.0)
            for _ in range(args.rounds):
                for _ in range(KILLS_A_ROUND):
                    polled, knew, ready = hilare.kill()
                    gone.append(polled)
                    known.append(knew)
                    ours.append(ready)
                    time.sleep(random.uniform(0.26, 0.4))
                peer.append(supervised.kill())
        finally:
            supervised.process.terminate()
            hilare.say("down")
            supervised.process.wait()
    print(f"{'ms':42}{'kills':>6}{'p50':>10}{'p99':>10}{'max':>10}")
    floor = figures("kernel: pidfd of the killed one, bare poll", gone)
    launch = figures("hilare: death known to launch", known)
    print("launch / bare poll" + " " * 30 + "".join(f"{a / b:10.2f}" for a, b in zip(launch, floor)))
    mine, theirs = figures("hilare: controller ready again", ours), figures("supervisord: program started again", peer)
    print("supervisord / hilare" + " " * 28 + "".join(f"{b / a:10.1f}" for a, b in zip(mine, theirs)))


if __name__ == "__main__":
    main()
