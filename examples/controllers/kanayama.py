#!/usr/bin/env python3
"""Kanayama's tracking law (paper 1, eq. 5, 7) as a controller outside of hilare.

    pip install iceoryx2==0.10.0
    hilare run rectangle --controller ./kanayama.py

The law is `twist`; the rest is what every external controller does (docs/controllers.md). The gains are
those of the robot's system file. Python 3.11 or later.
"""

import math
import os
import signal
import time
import tomllib

import hilare_wires as wires

# Between two looks at the wires, s: a tenth of a control period.
LOOK_S = 0.0005


def target(reference, pose):
    """Pose to be at and its yaw rate: x, y, heading, omega_r. On an arc, the place nearest to the robot."""
    begin, end = reference.last, reference.current
    dx, dy = end.x_m - begin.x_m, end.y_m - begin.y_m
    heading = math.atan2(dy, dx)
    if end.bulge == 0.0 or (dx == 0.0 and dy == 0.0):
        return end.x_m, end.y_m, heading, 0.0
    bulge, side = end.bulge, math.copysign(1.0, end.bulge)
    height = (1.0 - bulge * bulge) / (4.0 * bulge)
    centre_x = 0.5 * (begin.x_m + end.x_m) - height * dy
    centre_y = 0.5 * (begin.y_m + end.y_m) + height * dx
    radius = math.hypot(centre_x - begin.x_m, centre_y - begin.y_m)
    middle = heading - side * (math.pi / 2.0)
    turn = wrapped(math.atan2(pose.y_m - centre_y, pose.x_m - centre_x) - middle)
    x = centre_x + radius * math.cos(middle + turn)
    y = centre_y + radius * math.sin(middle + turn)
    curvature = 4.0 * bulge / (math.hypot(dx, dy) * (1.0 + bulge * bulge))
    return x, y, heading + turn, reference.speed_mps * curvature


def wrapped(angle):
    """The same angle in (-pi, pi]."""
    if -math.pi < angle <= math.pi:
        return angle
    angle = math.remainder(angle, math.tau)
    return angle + math.tau if angle <= -math.pi else angle


def twist(gains, reference, pose):
    """The law: forward speed, m/s, and yaw rate, rad/s."""
    x, y, heading, omega_r = target(reference, pose)
    # [MH18] (5): the error, seen by the robot.
    sin, cos = math.sin(pose.theta_rad), math.cos(pose.theta_rad)
    dx, dy = x - pose.x_m, y - pose.y_m
    x_e, y_e = cos * dx + sin * dy, -sin * dx + cos * dy
    theta_e = wrapped(heading - pose.theta_rad)
    sin_e, cos_e = math.sin(theta_e), math.cos(theta_e)
    if cos_e < 0.0 and abs(sin_e) < 1e-6:
        sin_e = 1.0  # Straight behind: the paper's robot would stand still for ever; this one turns left.
    # [MH18] (7)
    v_r = reference.speed_mps
    v = v_r * cos_e + gains["k1_per_s"] * x_e
    omega = omega_r + v_r * (gains["k2_per_m2"] * y_e + gains["k3_per_m"] * sin_e)
    return v, omega


def open_ports(config_file):
    """Readers of references and poses, writer of commands, and what must live as long as they do."""
    import iceoryx2 as iox2  # Here, so that the law can be had without it.

    iox2.set_log_level(iox2.LogLevel.Error)
    config = iox2.config.setup_global_config_from_file(iox2.FilePath.new(config_file))
    builder = iox2.NodeBuilder.new().config(config).name(iox2.NodeName.new("kanayama.py"))
    node = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)

    def service(wire):
        key, value = iox2.AttributeKey.new(wires.LAYOUT_ATTRIBUTE), iox2.AttributeValue.new(wire.layout)
        layout = iox2.AttributeVerifier.new().require(key, value)
        builder = node.service_builder(iox2.ServiceName.new(wire.service))
        return builder.publish_subscribe(wire.message).open_with_attributes(layout)

    def reader(wire):
        subscriber = service(wire).subscriber_builder().create()

        def receive():
            sample = subscriber.receive()
            return None if sample is None else wire.message.from_buffer_copy(sample.payload().contents)

        return receive

    writer = service(wires.COMMAND).publisher_builder().create()
    return reader(wires.REFERENCE), reader(wires.POSE), writer, node


def pairs(next_reference, next_pose):
    """Every reference with the pose of its tick; None when there is nothing to do yet."""
    # A reference may come before its pose, over the other wire. Only a later pose proves that its was lost.
    pose = None
    while True:
        while (reference := next_reference()) is None:
            yield None
        while pose is None or pose.tick < reference.tick:
            if (newer := next_pose()) is None:
                yield None
            else:
                pose = newer
        if pose.tick == reference.tick:
            yield reference, pose


def main():
    """Answers every reference until SIGTERM, or until launch is gone."""
    launch, told_to_end = os.getppid(), []
    signal.signal(signal.SIGTERM, lambda *_: told_to_end.append(True))
    source, epoch = int(os.environ["HILARE_SOURCE"]), int(os.environ["HILARE_EPOCH"])
    period = int(os.environ["HILARE_PERIOD_TICKS"])
    with open(os.environ["HILARE_SYSTEM"], "rb") as file:
        system = tomllib.load(file)
    next_reference, next_pose, commands, _node = open_ports(os.environ["HILARE_ICEORYX2_CONFIG"])
    seq = 0
    for pair in pairs(next_reference, next_pose):
        if told_to_end or os.getppid() != launch:
            return
        if pair is None:
            time.sleep(LOOK_S)
            continue
        reference, pose = pair
        tracking = reference.state == wires.ReferenceState.TRACKING
        v, omega = twist(system["controller"]["kanayama"], reference, pose) if tracking else (0.0, 0.0)
        seq += 1
        stamp = (source, epoch, seq, pose.tick, pose.tick + period)
        commands.send_copy(wires.Command(*stamp, vx_mps=v, omega_radps=omega))


if __name__ == "__main__":
    main()
