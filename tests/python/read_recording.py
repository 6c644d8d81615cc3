#!/usr/bin/env python3
"""Reads a recording of hilare with other people's readers, and works out what summary.json should say.

    read_recording.py mcap|rosbags FILE.mcap [FILE.mcap ...]

`mcap` is the mcap package with mcap-ros2-support, which decodes by the schemas in the file; `rosbags` knows no
ROS 2 either, and decodes standard messages by its own definitions. Prints JSON: the figures, as docs/guide.md
defines them, from the channels /hilare/* alone; what the standard ROS 2 topics say; how many messages each has.

It shares no code with hilare. The figures: of tick n counts the reference chosen on the pose of the last control
period before it; means are over every tick until the selector says that it has arrived.
"""

import json
import math
import struct
import sys
from pathlib import Path

ARRIVED, TRACKING = 2, 1
WINDOW = 100  # ticks of the true speed


def by_mcap(files):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    for file in files:
        with open(file, "rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
                yield channel.topic, schema.name, message.log_time, decoded


def by_rosbags(files):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    standard = get_typestore(Stores.ROS2_JAZZY)
    for file in files:
        with AnyReader([Path(file)]) as reader:
            for connection, time_ns, raw in reader.messages():
                kind = connection.msgtype
                if kind in standard.types:
                    decoded = standard.deserialize_cdr(raw, kind)
                else:
                    decoded = reader.deserialize(raw, kind)
                yield connection.topic, kind, time_ns, decoded


def distance(reference, x, y):
    """Of a point to the line, or the circle, through the last and the current waypoint."""
    ax, ay = reference.last.x_m, reference.last.y_m
    bx, by = reference.current.x_m, reference.current.y_m
    bulge = reference.current.bulge
    chord = math.hypot(bx - ax, by - ay)
    if bulge != 0.0 and chord > 0.0:
        radius = chord * (1 + bulge * bulge) / (4 * bulge)
        apothem = chord * (1 - bulge * bulge) / (4 * bulge)
        cx = (ax + bx) / 2 - apothem * (by - ay) / chord
        cy = (ay + by) / 2 + apothem * (bx - ax) / chord
        return abs(math.hypot(x - cx, y - cy) - abs(radius))
    if chord == 0.0:
        return 0.0
    return abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / chord


def figures(wires):
    steps = {m.tick: m for m in wires["/hilare/steps"]}
    poses = {m.tick: m for m in wires["/hilare/pose"]}
    truths = {m.tick: m for m in wires["/hilare/truth"]}
    references = {m.tick: m for m in wires["/hilare/reference"]}
    chosen_on = sorted(references)
    period = min(b - a for a, b in zip(chosen_on, chosen_on[1:]))
    hashed, ticks, reached = 0, 0, False
    cross, cross_max, speed, speed_truth, samples = 0.0, 0.0, 0.0, 0.0, 0
    track = []
    while True:
        tick = ticks + 1
        reference = references[(tick - 1) // period * period]
        if reference.state == ARRIVED:
            reached = True
            break
        if tick not in steps:
            break
        pose, truth, twist = poses[tick], truths[tick], steps[tick].twist
        for number in (pose.x_m, pose.y_m, pose.theta_rad):
            (word,) = struct.unpack("<Q", struct.pack("<d", number))
            rotated = (hashed << 5 | hashed >> 59) & 0xFFFF_FFFF_FFFF_FFFF
            hashed = (rotated ^ word) * 0x517C_C1B7_2722_0A95 & 0xFFFF_FFFF_FFFF_FFFF
        if reference.state == TRACKING:
            off = distance(reference, truth.x_m, truth.y_m)
            cross += off
            cross_max = max(cross_max, off)
        speed += abs(math.hypot(twist[0], twist[1]) - reference.speed_mps)
        track.append((truth.x_m, truth.y_m))
        if ticks >= WINDOW:
            x, y = track[ticks - WINDOW]
            moved = math.hypot(truth.x_m - x, truth.y_m - y)
            speed_truth += abs(moved / (WINDOW * 1e-3) - reference.speed_mps)
            samples += 1
        ticks += 1
    last = {"x_m": 0, "y_m": 0, "theta_rad": 0}
    return {
        "reached": reached,
        "ticks": ticks,
        "cross_track_mean_m": cross / ticks,
        "cross_track_max_m": cross_max,
        "speed_error_mean_mps": speed / ticks,
        "speed_error_truth_mean_mps": speed_truth / samples,
        "steps": [int(count) for count in steps[ticks].counts],
        "final_pose": {key: getattr(poses[ticks], key) for key in last},
        "final_truth": {key: getattr(truths[ticks], key) for key in last},
        "state_hash": f"{hashed:016x}",
    }


def heading(q):
    return 2 * math.atan2(q.z, q.w)


def near(a, b):
    return abs(math.remainder(a - b, 2 * math.pi)) < 1e-9


def views(wires):
    """What the standard topics say, held against ours; an error stops it all."""
    period = 5
    poses = {m.tick: m for m in wires["/hilare/pose"] if m.tick % period == 0}
    truths = {m.tick: m for m in wires["/hilare/truth"] if m.tick % period == 0}
    steps = {m.tick: m for m in wires["/hilare/steps"] if m.tick % period == 0}
    stamp = lambda header: header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
    origin = stamp(wires["/odom"][0].header)
    tick_of = lambda header: round((stamp(header) - origin) / 1e6)

    assert len(wires["/odom"]) == len(poses.keys() & steps.keys()) and len(wires["/tf"]) == len(poses)
    for odom, tf in zip(wires["/odom"], wires["/tf"]):
        tick = tick_of(odom.header)
        pose = poses[tick]
        assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
        at = odom.pose.pose.position
        assert (at.x, at.y, at.z) == (pose.x_m, pose.y_m, 0.0), tick
        assert near(heading(odom.pose.pose.orientation), pose.theta_rad), tick
        twist = odom.twist.twist
        assert [twist.linear.x, twist.linear.y, twist.angular.z] == list(steps[tick].twist), tick
        assert all(number == 0.0 for number in odom.pose.covariance) and len(odom.twist.covariance) == 36
        fixed, moving = tf.transforms
        assert (fixed.header.frame_id, fixed.child_frame_id) == ("map", "odom")
        assert (moving.header.frame_id, moving.child_frame_id) == ("odom", "base_link")
        assert stamp(moving.header) == stamp(odom.header) and fixed.transform.rotation.w == 1.0
        assert (moving.transform.translation.x, moving.transform.translation.y) == (at.x, at.y)
    for truth in wires["/ground_truth"]:
        ours = truths[tick_of(truth.header)]
        assert truth.header.frame_id == "map"
        assert (truth.pose.position.x, truth.pose.position.y) == (ours.x_m, ours.y_m)
        assert near(heading(truth.pose.orientation), ours.theta_rad)
    for command in wires["/cmd_vel"]:
        ours, twist = steps[tick_of(command.header)], command.twist
        assert [twist.linear.x, twist.linear.y, twist.angular.z] == list(ours.twist)
    for joints in wires["/joint_states"]:
        ours = steps[tick_of(joints.header)]
        assert list(joints.velocity) == list(ours.wheel_speed_radps)[: len(joints.name)]
        assert len(joints.position) == len(joints.name) and len(joints.effort) == 0
    # How far from the path: once a control period as soon as there is one, of the pose and of the truth.
    references = {m.tick: m for m in wires["/hilare/reference"]}
    for topic, places in (("/cross_track_error", poses), ("/cross_track_error/truth", truths)):
        told = [m.data for m in wires[topic]]
        # By the newest reference chosen before, once there is a later one.
        expected, before = [], None
        for tick in sorted(places.keys() | references.keys()):
            if tick in places and tick <= max(references) and before is not None and before.state != 0:
                expected.append(distance(before, places[tick].x_m, places[tick].y_m))
            before = references.get(tick, before)
        assert len(told) == len(expected) > 0, (topic, len(told), len(expected))
        assert max(abs(abs(a) - b) for a, b in zip(told, expected)) < 1e-12, topic
    path, ours = wires["/path"][-1], wires["/hilare/path"][-1]
    assert path.header.frame_id == "map"
    told = [(p.pose.position.x, p.pose.position.y) for p in path.poses]
    waypoints = [(w.x_m, w.y_m) for w in ours.elements]
    assert [place for place in told if place in waypoints] == waypoints
    indices = {(m.current.x_m, m.current.y_m) for m in wires["/hilare/reference"]}
    assert {(m.pose.position.x, m.pose.position.y) for m in wires["/reference"]} == indices
    status = [array.status[0] for array in wires["/diagnostics"]]
    level = lambda value: value[0] if isinstance(value, bytes) else int(value)
    assert all(level(s.level) == 0 for s in status if s.name == "step_generator")
    # Every process whose health was recorded, by its box and its slot.
    healths = {(m.slot, m.role) for m in wires.get("/hilare/health", [])}
    named = {tuple(s.name.removesuffix(")").split(" (slot ")) for s in status} - {("step_generator",)}
    assert {int(slot) for _, slot in named} == {slot for slot, _ in healths} and len(named) == len(healths), named
    role = dict(healths)
    assert len({(name, role[int(slot)]) for name, slot in named}) == len({name for name, _ in named})
    # What it keeps clear of obstacles, around it.
    for footprint in wires["/footprint"]:
        assert footprint.header.frame_id == "base_link"
        assert all(abs(math.hypot(p.x, p.y) - 0.037) < 1e-6 for p in footprint.polygon.points)
    return {"path_poses": len(told), "driving": sum(s.message == "driving" for s in status)}


def main():
    how, files = sys.argv[1], sys.argv[2:]
    wires, times = {}, {}
    for topic, kind, time_ns, message in {"mcap": by_mcap, "rosbags": by_rosbags}[how](files):
        wires.setdefault(topic, []).append(message)
        times.setdefault(topic, []).append(time_ns)
    # A millisecond a tick, on every wire that has one.
    steps, stamps = wires["/hilare/steps"], times["/hilare/steps"]
    epoch = stamps[0] - steps[0].tick * 1_000_000
    for topic in ("/hilare/steps", "/hilare/pose", "/hilare/truth", "/hilare/reference"):
        for message, time_ns in zip(wires[topic], times[topic]):
            assert time_ns == epoch + message.tick * 1_000_000, topic
    out = figures(wires)
    out["views"] = views(wires)
    out["messages"] = {topic: len(messages) for topic, messages in sorted(wires.items())}
    print(json.dumps(out))


main()
