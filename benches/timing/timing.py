"""docs/timing.md from runs of `hilare latency`.

A figure of a set of runs is the median of the runs' figures, so that one stall of the host decides nothing; the range of
the runs stands beside it. A ratio is taken in each run, between what was measured in the same milliseconds. Nothing is
trimmed inside a run.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
from pathlib import Path

HILARE = Path("target/release/hilare").resolve()
QUANTILES = ("p50", "p99", "p99_9", "max")
TICK_TARGETS = {"p50": 1.3, "p99": 1.25, "p99_9": 1.5, "max": 1.1}
ON_THE_TICK = ("step_generator", "pose_estimator", "waypoint_selector", "controller", "plant")


def on(cpu, *roles):
    return [f"realtime.{role}.cpu={cpu}" for role in roles]


def priority(value, *roles):
    return [f"realtime.{role}.priority={value}" for role in roles]


SCHEDULES = (
    ("all on the last core, in the loop's order (default)", []),
    ("the same, the clock spins 20 µs before its tick", ["wake_up.spin_us=20"]),
    ("the same, the clock spins 60 µs before its tick", ["wake_up.spin_us=60"]),
    ("the same, the core is kept awake", ["wake_up.keep_awake=true"]),
    ("the controller on the other core", on(0, "controller")),
    ("the clock alone on the last core, the rest on the other", on(0, *ON_THE_TICK[1:])),
    ("estimator and clock on the last core, the rest on the other", on(0, *ON_THE_TICK[2:])),
    ("time-triggered: estimator, selector, controller look 60, 100 and 150 µs after the tick",
     ["wake_up.pose_estimator_us=60", "wake_up.waypoint_selector_us=100", "wake_up.controller_us=150"]),
    ("time-triggered: 150, 250 and 350 µs after the tick",
     ["wake_up.pose_estimator_us=150", "wake_up.waypoint_selector_us=250", "wake_up.controller_us=350"]),
    ("all of one priority", priority(80, *ON_THE_TICK)),
    ("not pinned", on(-2, *ON_THE_TICK)),
    ("not pinned, without real time", on(-2, *ON_THE_TICK) + priority(0, *ON_THE_TICK)),
)


# Processes that come and go every 0.1 s, half of the time.
OBSERVERS = 12


def measure(name, seconds, out, *options, keys=(), again=True):
    directory = out / name
    if not again:
        return json.loads((directory / "latency.json").read_text())
    command = [HILARE, "latency", "--json", "--seconds", str(seconds), "--robot", f"timing{os.getpid()}"]
    command += ["--out", directory, *options]
    for key in keys:
        command += ["--set", key]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{name}: {done.stderr.strip()}")
    figures = json.loads(done.stdout)
    print(f"{name}: tick p99 {figures['tick']['ours']['p99']:.0f} us, {figures['tick']['ratio']['p99']:.2f} of the bare loop",
          file=sys.stderr)
    return figures


def middle(runs, pick):
    """Median, least and greatest over the runs."""
    values = [pick(run) for run in runs]
    return statistics.median(values), min(values), max(values)


def cell(runs, pick, decimals):
    median, least, most = middle(runs, pick)
    if len(runs) == 1:
        return f"{median:.{decimals}f}"
    return f"{median:.{decimals}f} ({least:.{decimals}f}–{most:.{decimals}f})"


def row(name, runs, pick, decimals):
    return f"| {name} | " + " | ".join(cell(runs, lambda run: pick(run)[q], decimals) for q in QUANTILES) + " |"


HEAD = "| | p50 | p99 | p99.9 | max |\n|---|---|---|---|---|"


def verdict(runs, pick, targets):
    missed = []
    for quantile, target in targets.items():
        value = middle(runs, lambda run: pick(run)[quantile])[0]
        if value > target:
            missed.append(f"{quantile.replace('_', '.')} {value:.2f} (target {target})")
    return "Targets met." if not missed else "Targets missed: " + ", ".join(missed) + "."


def section(title, runs):
    hop = lambda name: lambda kind: lambda run: next(hop for hop in run["hops"] if hop["name"] == name)[kind]
    whole = hop("steps->command")
    lines = [f"### {title}", "", f"{len(runs)} runs of {runs[0]['seconds']:.0f} s, "
             f"{sum(run['samples'] for run in runs)} ticks; the host took "
             f"{sum(run['steal_s'] for run in runs):.2f} s away from the machine in all."
             + (f" Load: {runs[0]['load_by']}." if runs[0]["load"] else ""), "",
             "Lateness of the tick, µs:", "", HEAD,
             row("hilare", runs, lambda run: run["tick"]["ours"], 1),
             row("bare loop", runs, lambda run: run["tick"]["bare_loop"], 1)]
    if all("cyclictest" in run["tick"] for run in runs):
        lines.append(row("cyclictest", runs, lambda run: run["tick"]["cyclictest"], 0))
    lines += [row("ratio to the bare loop", runs, lambda run: run["tick"]["ratio"], 2),
              row("the tick's own work", runs, lambda run: run["work"], 1), "",
              verdict(runs, lambda run: run["tick"]["ratio"], TICK_TARGETS), "",
              "Messages on their way, µs:", "", HEAD]
    for name in (hop["name"] for hop in runs[0]["hops"]):
        lines += [row(f"{name}: hilare", runs, hop(name)("ours"), 1),
                  row(f"{name}: bare futex", runs, hop(name)("futex"), 1),
                  row(f"{name}: bare iceoryx2", runs, hop(name)("iceoryx2"), 1),
                  row(f"{name}: ratio to futex", runs, hop(name)("ratio"), 2),
                  row(f"{name}: ratio to iceoryx2", runs, hop(name)("ratio_iceoryx2"), 2)]
    cycle = middle(runs, lambda run: whole("ours")(run)["p99"])[0]
    late = sum(run["commands_late"] for run in runs)
    beside = sum(run["commands_late_beside_stalls"] for run in runs)
    causes = {}
    for run in runs:
        for cause, count in run["causes"].items():
            causes[cause] = causes.get(cause, 0) + count
    counts = {}
    for run in runs:
        for process in run["processes"]:
            of = counts.setdefault(process["name"], [0, 0, 0])
            for n, count in enumerate(("over_budget", "page_faults", "involuntary_switches")):
                of[n] += process[count]
    lines += ["", "| process | steps over budget | page faults | involuntary switches |", "|---|---|---|---|"]
    lines += [f"| {name} | {of[0]} | {of[1]} | {of[2]} |" for name, of in counts.items()]
    lines += ["", "Steps to command against as many bare futex hops: "
              + verdict(runs, whole("ratio"), {"p99": 1.5})
              + f" The whole way takes {cycle / 50:.1f} % of a control period of 5 ms at p99. "
              + f"Commands late: {late}, {beside} of them within 50 ms of a stall of the bare loop, which stalled "
              + f"{sum(run['bare_stalls'] for run in runs)} times.", "",
              "Ticks late by 0.1 ms or more: "
              + ("; ".join(f"{count}: {cause}" for cause, count in causes.items() if count) or "none") + ".", ""]
    return lines


def looking(alone, recorded, watched):
    """What those who look cost the tick; `watched` holds turns with and without observers in each run."""
    joins = sum(run["watched"]["joins"] for run in watched)
    messages = sum(run["watched"]["messages"] for run in watched)
    lines = ["### Looked at", "",
             f"In turn with the idle runs: as many with no recorder, and as many in which {OBSERVERS} more processes read the "
             f"relay's wires at full rate, joining and leaving every 0.1 s, every other five seconds: {joins} joins, "
             f"{messages} messages read. µs.", "", HEAD]
    tick = lambda run: run["tick"]["ours"]
    turns = lambda kind, side: lambda run: run["watched"][kind][side]
    lines += [row("tick, no recorder, nobody looks", alone, tick, 1), row("tick, recorder", recorded, tick, 1),
              row(f"tick, recorder, {OBSERVERS} observers away", watched, turns("tick", "without"), 1),
              row(f"tick, recorder, {OBSERVERS} observers come and go", watched, turns("tick", "with"), 1),
              row("ratio of the last two", watched, turns("tick", "ratio"), 2),
              row("the same ratio of the bare loop", watched, turns("bare_loop", "ratio"), 2)]
    for title, kind in (("the tick's own work", "work"), ("steps->command", "steps_to_command")):
        lines += [row(f"{title}, observers away", watched, turns(kind, "without"), 1),
                  row(f"{title}, observers come and go", watched, turns(kind, "with"), 1),
                  row("ratio", watched, turns(kind, "ratio"), 2)]
    return lines + ["", "What the bare loop's ratio has above 1, the observers' own processor time costs any program.", ""]


def machine():
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
    virtual = "a virtual machine" if "hypervisor" in open("/proc/cpuinfo").read() else "bare metal"
    return f"{os.cpu_count()} × {cpu}, {virtual}, Linux {platform.release().split('-')[0]}"


METHOD = """# Timing

Written by `benches/timing/run`; every number here is of the machine below, and yours differ: run it there.

## Method

`hilare latency` runs a whole robot (eight processes over iceoryx2, recorder included) in real time. On the same core, with
the same priorities, in the same milliseconds and half a tick apart run a bare loop that sleeps until an absolute time, as
cyclictest does, and chains of three bare hops: futexes in shared memory and iceoryx2's own publish-subscribe with its event.
The three who answer have the priorities of pose estimator, waypoint selector and controller. A ratio is taken
between figures of the same run; a cell is the median of the runs with the least and the greatest. Nothing is trimmed; quantiles
are upper edges of buckets a sixteenth wide, maxima are exact.

A hop lasts from just before a message is sent until its reader has it. `steps->command` lasts from just before the steps are
sent until the command they lead to is out: three hops and what three boxes compute.
"""

LIMITS = """## What limits them

- Lateness is the machine's: the timer's interrupt, the wake of an idle core and the switch to the process cost the bare loop as
  much. Spinning before the tick takes that away at the price of processor time; keeping the core awake halves p99.
- After the sleep between two ticks neither code nor data of a box is in the caches: a send of iceoryx2 that takes 0.3 µs when
  it is repeated takes 3 to 8 µs there. That, not the futex, is what a hop costs above a bare one.
- Whoever makes files and mappings keeps the kernel busy where no real-time process can interrupt it. With the runtime directory on a
  disk, twelve processes that come and go raised p99 of the tick from 70 to 600 µs, and that of the bare loop as much; on a tmpfs both stay
  (`HILARE_RUNTIME_DIR=/var/tmp/x hilare latency --observers 12` shows it). So that directory is on `/dev/shm` or `$XDG_RUNTIME_DIR`, and relay,
  recorder and `hilare topic` keep off the last processor.
- The tick's own work holds the wake-up of the pose estimator (a system call) and the send, of which each is a third; the step
  itself and keeping its state are about 1 µs together.
"""


def schedules(runs):
    lines = ["## Schedules that were tried", "",
             "One run each, idle, one after the other; µs, and ratios to the bare loop and the bare futex hops of the same run.", "",
             "| schedule | tick p50 | p99 | of the bare loop p99 | steps->command p50 | p99 | of bare futex p99 | own work p99 |",
             "|---|---|---|---|---|---|---|---|"]
    for name, run in runs:
        whole = run["hops"][-1]
        lines.append(f"| {name} | {run['tick']['ours']['p50']:.1f} | {run['tick']['ours']['p99']:.1f} "
                     f"| {run['tick']['ratio']['p99']:.2f} | {whole['ours']['p50']:.1f} | {whole['ours']['p99']:.1f} "
                     f"| {whole['ratio']['p99']:.2f} | {run['work']['p99']:.1f} |")
    return lines + [""]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--schedule-seconds", type=float, default=30)
    parser.add_argument("--report", type=Path, default=Path("docs/timing.md"))
    parser.add_argument("--report-only", action="store_true", help="from the runs in target/timing, measuring nothing")
    args = parser.parse_args()
    out = Path("target/timing")
    again = not args.report_only
    idle, loaded, alone, watched = [], [], [], []
    for number in range(1, args.rounds + 1):
        idle.append(measure(f"idle-{number}", args.seconds, out, again=again))
        loaded.append(measure(f"loaded-{number}", args.seconds, out, "--load", again=again))
        alone.append(measure(f"alone-{number}", args.seconds, out, "--no-recorder", again=again))
        observers = ("--observers", str(OBSERVERS))
        watched.append(measure(f"watched-{number}", args.seconds, out, *observers, again=again))
    tried = [(name, measure(f"schedule-{number}", args.schedule_seconds, out, keys=keys, again=again))
             for number, (name, keys) in enumerate(SCHEDULES)]
    granted = idle[0]["granted"]
    text = [METHOD, "## Machine", "",
            f"{machine()}. The clock was granted {granted['policy']} {granted['priority']}, cpu {granted['cpu']}, "
            f"{'memory locked' if granted['mlock'] else 'memory not locked'}.", "", "## Figures", ""]
    text += section("Idle", idle) + section("Every core loaded", loaded)
    text += looking(alone, idle, watched) + schedules(tried) + [LIMITS]
    args.report.write_text("\n".join(text))
    print(f"{args.report}; raw histograms and pictures: {out}")


if __name__ == "__main__":
    main()
