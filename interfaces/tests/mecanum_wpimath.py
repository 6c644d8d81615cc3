"""Reference numbers for mecanum_wpimath.rs, from WPILib's MecanumDriveKinematics.

    pip install robotpy-wpimath==2026.2.2
    python mecanum_wpimath.py

prints the two tables; paste them over those of mecanum_wpimath.rs. WPILib: x forwards, y left, yaw rate
counter-clockwise (as REP-103), wheels front left, front right, rear left, rear right, speeds of the rims in
m/s; all as here but for the wheel speeds, which are divided by the radius.
"""

import random

from wpimath.geometry import Translation2d
from wpimath.kinematics import ChassisSpeeds, MecanumDriveKinematics, MecanumDriveWheelSpeeds

# Half wheelbase, half track, wheel radius, m: three robots, one as wide as long, one wider.
ROBOTS = [(0.2, 0.15, 0.05), (0.3, 0.3, 0.076), (0.085, 0.22, 0.03)]


def kinematics(half_wheelbase, half_track):
    place = [Translation2d(sx * half_wheelbase, sy * half_track) for sx in (1, -1) for sy in (1, -1)]
    return MecanumDriveKinematics(*place)


def row(*groups):
    texts = ["[" + ", ".join(str(round(value, 12)) for value in group) + "]" for group in groups]
    print("    (" + ", ".join(texts) + "),")


def main():
    rng = random.Random(20180426)
    units = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    print("TO_WHEELS")
    for robot in ROBOTS:
        drive = kinematics(*robot[:2])
        for twist in units + [tuple(round(rng.uniform(-1.5, 1.5), 3) for _ in range(3)) for _ in range(3)]:
            rims = drive.toWheelSpeeds(ChassisSpeeds(*twist))
            rims = (rims.frontLeft, rims.frontRight, rims.rearLeft, rims.rearRight)
            row(robot, twist, tuple(rim / robot[2] for rim in rims))
    print("TO_TWIST")
    for robot in ROBOTS:
        drive = kinematics(*robot[:2])
        for _ in range(4):
            wheels = tuple(round(rng.uniform(-20.0, 20.0), 3) for _ in range(4))
            speeds = drive.toChassisSpeeds(MecanumDriveWheelSpeeds(*(wheel * robot[2] for wheel in wheels)))
            row(robot, wheels, (speeds.vx, speeds.vy, speeds.omega))


if __name__ == "__main__":
    main()
