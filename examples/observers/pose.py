#!/usr/bin/env python3
"""Prints where a robot is, from outside of hilare and without disturbing it.

    pip install iceoryx2==0.10.0
    hilare up epuck --detach && hilare arm && hilare goal 0.5 0
    ./pose.py                  # ten lines a second, until the robot goes down or Ctrl-C
    ./pose.py --all --json     # every pose, an object a line

It reads `watch/pose`, which the relay repeats for whoever wants to look (docs/controllers.md), never a wire of the
loop, where a reader that joins delays the tick. Python 3.9 or later.
"""

import argparse
import json
import os
import select
import signal
import sys
import time
from pathlib import Path

# The wires lie with the examples of controllers; in a copy elsewhere, beside this file.
sys.path.append(str(Path(__file__).resolve().parent.parent / "controllers"))
import hilare_wires as wires

# Between two looks, s. The wire keeps the newest 1024 poses, a second of them.
LOOK_S = 0.002


class Robot:
    """A robot of this user that is up: its directory, and a way to see that it has gone."""

    def __init__(self, name):
        lock = Path(f"/dev/shm/hilare.{os.getuid()}.{name}-lock")
        try:
            if lock.stat().st_uid != os.getuid():
                raise FileNotFoundError
            pid, directory = lock.read_text().rstrip("\n").split("\n", 1)
            self._launch = os.pidfd_open(int(pid))
        except (FileNotFoundError, ProcessLookupError, ValueError):
            raise SystemExit(f"pose.py: no robot {name!r} is up; hilare up SYSTEM --robot {name}") from None
        self.config_file = str(Path(directory) / "iceoryx2.toml")

    def is_gone(self):
        """True once its launch has ended."""
        return bool(select.select([self._launch], [], [], 0)[0])


def open_reader(robot, wire):
    """A function that returns the next message or None, and what must live as long as it is used."""
    import iceoryx2 as iox2

    iox2.set_log_level(iox2.LogLevel.Error)
    config = iox2.config.setup_global_config_from_file(iox2.FilePath.new(robot.config_file))
    builder = iox2.NodeBuilder.new().config(config).name(iox2.NodeName.new("pose.py"))
    node = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    # A robot of another version lays its messages out otherwise: refused, instead of misread.
    key, value = iox2.AttributeKey.new(wires.LAYOUT_ATTRIBUTE), iox2.AttributeValue.new(wire.layout)
    layout = iox2.AttributeVerifier.new().require(key, value)
    builder = node.service_builder(iox2.ServiceName.new(wire.service)).publish_subscribe(wire.message)
    try:
        subscriber = builder.open_with_attributes(layout).subscriber_builder().create()
    except iox2.PublishSubscribeOpenError as error:
        what = f"{wire.service} with layout {wire.layout!r}: {error}"
        raise SystemExit(f"pose.py: {what}; is hilare_wires.py of the robot's version?") from None

    def receive():
        sample = subscriber.receive()
        return None if sample is None else wire.message.from_buffer_copy(sample.payload().contents)

    return receive, (node, subscriber)


def line(pose, as_json):
    """A pose for people, or with every bit."""
    if as_json:
        return json.dumps({name: getattr(pose, name) for name, _ in pose._fields_})
    return f"tick {pose.tick}  x {pose.x_m:.6f} m  y {pose.y_m:.6f} m  heading {pose.theta_rad:.6f} rad"


def main():
    """Prints poses until the robot goes down, Ctrl-C, or nobody reads."""
    parser = argparse.ArgumentParser(description="Prints where a robot is.")
    parser.add_argument("robot", nargs="?", default="epuck", help="name of the robot [default: epuck]")
    parser.add_argument("--rate", type=float, default=10.0, help="lines a second [default: 10]")
    parser.add_argument("--all", action="store_true", help="every pose")
    parser.add_argument("--json", action="store_true", help="an object a line")
    args = parser.parse_args()
    if not 0.0 < args.rate <= 1000.0:
        parser.error(f"--rate {args.rate}: above 0 and at most 1000 are wanted")

    told_to_end = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told_to_end.append(True))
    robot = Robot(args.robot)
    receive, _alive = open_reader(robot, wires.WATCH_POSE)
    due, seen, missed, last = time.monotonic(), 0, 0, None
    gone = False
    while not (told_to_end or gone):
        # Asked before the last look, so that nothing is left on the wire.
        gone = robot.is_gone()
        newest = None
        while (pose := receive()) is not None:
            seen += 1
            missed += 0 if last is None else max(0, pose.tick - last - 1)
            last, newest = pose.tick, pose
            if args.all:
                print(line(pose, args.json))
        if newest is not None and not args.all and time.monotonic() >= due:
            due = max(due + 1.0 / args.rate, time.monotonic())
            print(line(newest, args.json))
        sys.stdout.flush()
        time.sleep(LOOK_S)
    print(f"pose.py: {seen} poses, {missed} missed", file=sys.stderr)


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        # Nobody reads any more; and nobody is to hear of it when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
