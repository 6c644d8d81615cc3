#!/usr/bin/env python3
"""What recording costs a robot; see ./run."""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PAGE = os.sysconf("SC_PAGE_SIZE")
HERTZ = os.sysconf("SC_CLK_TCK")


def recorder_of(launch):
    """Process id of the recorder that a launch has started."""
    children = Path(f"/proc/{launch}/task/{launch}/children").read_text().split()
    for pid in children:
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"recorder" in words[1:3]:
            return int(pid)
    return None


def look(pid):
    """Resident memory, kB, its high-water mark, kB, and processor time, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    peak = next(l for l in Path(f"/proc/{pid}/status").read_text().splitlines() if l.startswith("VmHWM:"))
    return int(fields[21]) * PAGE // 1024, int(peak.split()[1]), (int(fields[11]) + int(fields[12])) / HERTZ


def turn(hilare, args, record):
    with tempfile.TemporaryDirectory(dir=args.dir) as folder:
        file = Path(folder) / "run.mcap"
        command = [hilare, "latency", "--json", "--seconds", str(args.seconds), "--robot", f"bench-{os.getpid()}"]
        command += ["--record", str(file)] if record else []
        command += ["--load"] if args.load else []
        began = time.monotonic()
        launch = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        looks = []
        while launch.poll() is None and time.monotonic() - began < args.seconds - 1:
            time.sleep(min(1.0, args.seconds / 20))
            try:
                pid = recorder_of(launch.pid)
                if pid:
                    looks.append((time.monotonic() - began, *look(pid)))
            except (OSError, StopIteration):
                pass
        out, errors = launch.communicate()
        if launch.returncode != 0:
            sys.exit(f"hilare latency ended with {launch.returncode}: {errors.strip()}")
        figures = json.loads(out)
        # The first seconds are not the rule.
        looks = looks[len(looks) // 10 :]
        (t0, first, _, cpu0), (t1, last, peak, cpu1) = looks[0], looks[-1]
        return {
            "recording": record,
            "tick": figures["tick"]["ours"],
            "bare": figures["tick"]["bare_loop"],
            "commands_late": figures["commands_late"],
            "rss_first_kb": first,
            "rss_last_kb": last,
            "rss_peak_kb": peak,
            "cpu_percent": 100 * (cpu1 - cpu0) / (t1 - t0),
            "megabytes": sum(part.stat().st_size for part in Path(folder).glob("*.mcap")) / 1e6,
        }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--load", action="store_true", help="beside stress-ng")
    parser.add_argument("--dir", help="where the recordings are written meanwhile [default: $TMPDIR]")
    parser.add_argument("--hilare", default="target/release/hilare")
    parser.add_argument("--json", help="write the figures there")
    args = parser.parse_args()
    print(f"{'':14}{'tick late, us: p50':>20}{'p99':>8}{'p99.9':>9}{'max':>9}   bare: p99{'p99.9':>9}"
          f"   recorder: cpu %   RSS MB first, last, peak    MB/min")
    turns = []
    for number in range(args.rounds):
        # Whoever comes first shall not always be the same.
        for record in (True, False) if number % 2 == 0 else (False, True):
            done = turn(args.hilare, args, record)
            turns.append(done)
            tick, bare = done["tick"], done["bare"]
            rss = [done[key] / 1000 for key in ("rss_first_kb", "rss_last_kb", "rss_peak_kb")]
            print(f"{'recording' if record else 'not recording':14}{tick['p50']:>20.1f}{tick['p99']:>8.1f}"
                  f"{tick['p99_9']:>9.1f}{tick['max']:>9.1f}{bare['p99']:>12.1f}{bare['p99_9']:>9.1f}"
                  f"{done['cpu_percent']:>18.1f}{rss[0]:>13.1f}{rss[1]:>7.1f}{rss[2]:>7.1f}"
                  f"{done['megabytes'] * 60 / args.seconds:>10.1f}", flush=True)
    print("nothing is missing in the recordings: hilare latency fails if anything is")
    if args.json:
        Path(args.json).write_text(json.dumps(turns, indent=1) + "\n")


main()
