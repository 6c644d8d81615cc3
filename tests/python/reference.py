#!/usr/bin/env python3
"""Paper 1 (Mathew & Hiremath, Engineering 4, 2018), equation by equation, in the paper's millimetres.

An independent oracle for hilare: it shares no code, no unit and no data type with it. For each waypoint
file given (CSV, header ``x,y``, metres) it drives the e-puck of the paper's table 1 with the gains of point
A, starting on the first waypoint with heading 0, and prints what hilare's summary.json says, as JSON.

    reference.py [--nudge DX,DY] FILE.csv [FILE.csv ...]

Where the paper leaves a choice: the heading of the segment that ends in the current waypoint (6), one waypoint
accepted a control period, commands that act one control period after their pose ("lag 5"), Euler dead
reckoning with the heading updated after x and y (31). cross_track_* and final_truth are of a robot that rolls
along exact arcs on the same steps; cross_track_*_euler_m and final_pose are of the dead reckoning.

--nudge starts the dead reckoning DX, DY millimetres off. It is no part of the paper: (7) has a gain of 118
rad/s a millimetre and (28) compares with a threshold, so once in some hundred paths a rounding error decides
in which tick a pulse falls, and from there on two correct programs part. A nudge of 1e-10 mm or less, a
thousandth of an atom, shows what a path has to offer in this way.
"""

import csv
import json
import math
import sys

# Table 1, table 2 (point A); millimetres, seconds, radians.
TRACK = 54.0  # w_T
WHEEL = 40.0  # d_w, diameter
STEP_ANGLE = 0.13 / (WHEEL / 2)  # beta: 0.13 mm at the rim
WHEEL_MAX = 3.25  # omega_1max = omega_2max
TICK = 1e-3  # delta t
LAG = 5  # T_lag in ticks
V_REF, W_REF = 40.0, 0.0  # v_r, omega_r
V_MIN, V_MAX = 0.0, 41.0
W_MIN, W_MAX = 0.0, 0.747
K1, K2, K3 = 0.0247, 2.9671, 0.552
ACCEPT = TRACK / 2  # d_T

# (30), (3): heading gained by one step of the right wheel.
HEADING_PER_STEP = WHEEL / (2 * TRACK) * STEP_ANGLE
# (17)
TOP_SPEED = WHEEL / 4 * (WHEEL_MAX + WHEEL_MAX)
# Nothing drives for an hour in a test.
TICKS_MAX = 3_600_000


def read_waypoints(path):
    """Waypoints of a CSV in metres, as millimetres."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        return [(1000.0 * float(row["x"]), 1000.0 * float(row["y"])) for row in rows]


def control(pose, last, current):
    """Selector's reference and pose to the commanded (v_c, w_c): (5), (6), (7)."""
    x, y, heading = pose
    wanted = math.atan2(current[1] - last[1], current[0] - last[0])  # (6)
    dx, dy = current[0] - x, current[1] - y
    x_e = math.cos(heading) * dx + math.sin(heading) * dy  # (5)
    y_e = -math.sin(heading) * dx + math.cos(heading) * dy
    turn = wanted - heading
    heading_e = math.atan2(math.sin(turn), math.cos(turn))
    v_c = V_REF * math.cos(heading_e) + K1 * x_e  # (7)
    w_c = W_REF + V_REF * (K2 * y_e + K3 * math.sin(heading_e))
    return v_c, w_c


def constrain(v_c, w_c):
    """Input constraints: (9)-(16) the clamps, (18)-(24) the motor diamond, curvature kept."""
    v = min(max(v_c, V_MIN), V_MAX)
    w = 0.0 if w_c == 0.0 else math.copysign(min(max(abs(w_c), W_MIN), W_MAX), w_c)
    use = abs(v) / TOP_SPEED + abs(w) * TRACK / (2 * TOP_SPEED)
    return (v / use, w / use) if use > 1.0 else (v, w)


def pulse(owed):
    """(28), both directions."""
    if owed >= STEP_ANGLE:
        return 1
    return -1 if owed <= -STEP_ANGLE else 0


class Track:
    """Cross-track distance to the line through two waypoints: sum and maximum."""

    def __init__(self):
        self.sum = 0.0
        self.max = 0.0

    def add(self, x, y, last, current):
        ux, uy = current[0] - last[0], current[1] - last[1]
        distance = abs(ux * (y - last[1]) - uy * (x - last[0])) / math.hypot(ux, uy)
        self.sum += distance
        self.max = max(self.max, distance)


def drive(waypoints, nudge=(0.0, 0.0)):
    """One run. The figures in SI, named as in summary.json."""
    x, y, heading = waypoints[0][0], waypoints[0][1], 0.0
    true_x, true_y = x, y
    x, y = x + nudge[0], y + nudge[1]
    index = 1
    v = w = 0.0
    coming = None  # the command that acts at the next control period
    owed_right = owed_left = 0.0
    right = left = 0
    estimated, true = Track(), Track()
    speed_error = 0.0
    tick = 0
    while tick < TICKS_MAX:
        if tick % LAG == 0:
            if math.hypot(waypoints[index][0] - x, waypoints[index][1] - y) <= ACCEPT:  # (8)
                index += 1
            if index == len(waypoints):
                break
            last, current = waypoints[index - 1], waypoints[index]
            if coming is not None:
                v, w = coming
            coming = constrain(*control((x, y, heading), last, current))
        owed_right += (2 * v + TRACK * w) / WHEEL * TICK  # (4), (26), (27)
        owed_left += (2 * v - TRACK * w) / WHEEL * TICK
        step_right, step_left = pulse(owed_right), pulse(owed_left)
        owed_right -= STEP_ANGLE * step_right  # (29)
        owed_left -= STEP_ANGLE * step_left
        right += step_right
        left += step_left
        moved = WHEEL / 4 * STEP_ANGLE * (step_right + step_left)  # (30), (3) times delta t
        # (31) for the heading is linear in the steps, so its sum is taken in whole steps. Adding up floats
        # instead drifts by 1e-12 rad in half a minute; k2 v_r makes that 1e-8 rad/s at 100 mm, and on one path
        # in twenty this moved a pulse by a tick.
        turned_to = HEADING_PER_STEP * (right - left)
        # The truth rolls along the arc: its chord points along the mean heading.
        half = (turned_to - heading) / 2
        chord = moved if half == 0.0 else moved * math.sin(half) / half
        true_x += chord * math.cos(heading + half)
        true_y += chord * math.sin(heading + half)
        x += moved * math.cos(heading)  # (31), (2)
        y += moved * math.sin(heading)
        heading = turned_to
        estimated.add(x, y, last, current)
        true.add(true_x, true_y, last, current)
        speed_error += abs(v - V_REF)
        tick += 1
    ticks = max(tick, 1)
    return {
        "reached": index == len(waypoints),
        "ticks": tick,
        "steps": [right, left],
        "cross_track_mean_m": true.sum / ticks * 1e-3,
        "cross_track_max_m": true.max * 1e-3,
        "cross_track_mean_euler_m": estimated.sum / ticks * 1e-3,
        "cross_track_max_euler_m": estimated.max * 1e-3,
        "speed_error_mean_mps": speed_error / ticks * 1e-3,
        "final_pose": {"x_m": x * 1e-3, "y_m": y * 1e-3, "theta_rad": heading},
        "final_truth": {"x_m": true_x * 1e-3, "y_m": true_y * 1e-3, "theta_rad": heading},
    }


def main(arguments):
    nudge = (0.0, 0.0)
    if arguments[:1] == ["--nudge"] and len(arguments) > 1:
        nudge, arguments = tuple(map(float, arguments[1].split(","))), arguments[2:]
    if not arguments or arguments[0].startswith("-"):
        sys.exit(__doc__)
    runs = [{"file": path, **drive(read_waypoints(path), nudge)} for path in arguments]
    json.dump(runs, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main(sys.argv[1:])
