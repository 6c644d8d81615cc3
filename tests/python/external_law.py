"""What examples/controllers/kanayama.py answers, for tests/external.rs.

Arguments: the directory of the example, k1, k2, k3. A line of input is a Reference and a Pose as they lie in
memory, in hexadecimal; a line of output is the bits of the speed and of the yaw rate.
"""

import struct
import sys

sys.path.insert(0, sys.argv[1])

import hilare_wires as wires
import kanayama

gains = dict(zip(("k1_per_s", "k2_per_m2", "k3_per_m"), map(float, sys.argv[2:])))
for line in sys.stdin:
    reference, pose = map(bytes.fromhex, line.split())
    reference, pose = wires.Reference.from_buffer_copy(reference), wires.Pose.from_buffer_copy(pose)
    print(*(struct.pack(">d", value).hex() for value in kanayama.twist(gains, reference, pose)))
