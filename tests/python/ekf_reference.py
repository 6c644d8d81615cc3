#!/usr/bin/env python3
"""What the Kalman filter should find, by another way: batch maximum a posteriori.

Writes services/pose_estimator/tests/data/ekf_reference.csv, which tests/reference.rs there reads:

    c,tick,right,left                      cumulative step counts
    f,tick,x,y,theta                       a fix, without delay
    r,tick,x,y,theta,s0,s1,s2,sd...        pose and scale errors given the fixes up to here, and their six sds

No recursion: the unknowns are the start, the scale errors and the noise of every step of every wheel, all at
once, and Gauss-Newton with derivatives by the complex step minimises the sum of squares of priors and fixes.
In the linear case that is what a Kalman filter must give; here it nearly is.

    pip install numpy; python3 tests/python/ekf_reference.py
"""

import math
import pathlib

import numpy as np

STEP_M, TRACK_M = 0.00013, 0.054
CAMERA = np.array([0.001, 0.001, 0.005])
START = np.array([0.2, 0.2, 0.0])
START_SD = np.array([0.02, 0.02, 0.1])
SCALE_SD = np.array([0.05, 0.01, 0.03])
DRIFT, SLIP = 0.002, 0.0003
TICKS, PERIOD = 800, 40
REPORTED = (0, 40, 200, 400, 800)
OUT = pathlib.Path(__file__).parents[2] / "services/pose_estimator/tests/data/ekf_reference.csv"


def drive():
    """Steps of the right and the left wheel, tick by tick: straight, an S, a turn in place."""
    owed, steps = np.zeros(2), []
    for tick in range(1, TICKS + 1):
        v, omega = (0.06, 0.9 * math.sin(tick / 90)) if tick < 600 else (0.0, 1.5)
        owed += np.array([v + omega * TRACK_M / 2, v - omega * TRACK_M / 2]) * 1e-3 / STEP_M
        n = np.trunc(owed)
        owed -= n
        steps.append(n)
    return np.array(steps)


def roll(steps, unknowns):
    """Poses and scale errors after every tick; unknowns in units of their sd, one column a hypothesis."""
    pose = START[:, None] + START_SD[:, None] * unknowns[:3]
    scale = SCALE_SD[:, None] * unknowns[3:6]
    at = 6
    poses, scales = [pose], [scale]
    for n in steps:
        if n.any():
            noise = unknowns[at : at + 5]
            at += 5
            off = SLIP * np.sqrt(np.abs(n) * STEP_M)[:, None] * noise[:2]
            right = n[0] * STEP_M * (1 + scale[0] + scale[1] / 2) + off[0]
            left = n[1] * STEP_M * (1 + scale[0] - scale[1] / 2) + off[1]
            # The track's error acts on the turn that the counts say, not on the noise of it.
            turn = (right - left) / TRACK_M + (n[0] - n[1]) * STEP_M / TRACK_M * scale[2]
            way, end = (right + left) / 2, pose[2] + turn
            # Radius times difference of sines; a chord where it is straight.
            bent = np.abs(turn) > 1e-6
            radius = way / np.where(bent, turn, 1)
            x = np.where(bent, radius * (np.sin(end) - np.sin(pose[2])), way * np.cos(pose[2] + turn / 2))
            y = np.where(bent, radius * (np.cos(pose[2]) - np.cos(end)), way * np.sin(pose[2] + turn / 2))
            pose = np.stack([pose[0] + x, pose[1] + y, end])
            scale = scale + DRIFT * np.sqrt(np.abs(n).sum() / 2 * STEP_M) * noise[2:]
        poses.append(pose)
        scales.append(scale)
    return poses, scales


def with_derivatives(steps, unknowns):
    """Poses, scale errors and their derivatives by the unknowns, by the complex step."""
    h = 1e-30
    columns = unknowns[:, None] + 1j * h * np.eye(len(unknowns))
    poses, scales = roll(steps, columns)
    return [[(m.real[:, 0], m.imag / h) for m in kind] for kind in (poses, scales)]


def estimate(steps, fixes):
    unknowns = np.zeros(6 + 5 * int(steps.any(axis=1).sum()))
    for _ in range(8):
        poses, scales = with_derivatives(steps, unknowns)
        residuals, rows = [-unknowns], [np.eye(len(unknowns))]
        for tick, fix in fixes:
            if tick <= len(steps):
                pose, by = poses[tick]
                residuals.append((fix - pose) / CAMERA)
                rows.append(by / CAMERA[:, None])
        a, b = np.vstack(rows), np.concatenate(residuals)
        covariance = np.linalg.inv(a.T @ a)
        change = covariance @ (a.T @ b)
        unknowns += change
        if np.abs(change).max() < 1e-12:
            break
    poses, scales = with_derivatives(steps, unknowns)
    (pose, by_pose), (scale, by_scale) = poses[-1], scales[-1]
    by = np.vstack([by_pose, by_scale])
    return np.concatenate([pose, scale, np.sqrt(np.diag(by @ covariance @ by.T))])


def main():
    random = np.random.default_rng(7)
    steps = drive()
    truth, _ = roll(steps, random.standard_normal((6 + 5 * int(steps.any(axis=1).sum()), 1)))
    fixes = [(t, truth[t][:, 0] + CAMERA * random.standard_normal(3)) for t in range(0, TICKS + 1, PERIOD)]
    rows = []
    for tick, (right, left) in enumerate(steps.cumsum(axis=0).astype(int), 1):
        rows.append(f"c,{tick},{right},{left}")
    for tick, fix in fixes:
        rows.append(f"f,{tick}," + ",".join(repr(float(v)) for v in fix))
    for tick in REPORTED:
        rows.append(f"r,{tick}," + ",".join(repr(float(v)) for v in estimate(steps[:tick], fixes)))
    OUT.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
