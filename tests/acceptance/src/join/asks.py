"""Plans as a client that is set up for a robot file, and says how that is answered and what the bytes of the knots that it received hash
to, by FNV-1a: asks.py ROBOT_FILE."""

import sys

import pcc

answer = pcc.Client(robot_file=sys.argv[1]).plan([1.0, 0.5, 2.3], start=[0.0] * 6)
print(f"{answer.outcome}: {answer.reason}")
received = b"".join(candidate.knots.tobytes() for candidate in answer)
fnv1a = 0xCBF29CE484222325
for byte in received:
    fnv1a = (fnv1a ^ byte) * 0x100000001B3 % 2**64
print(f"{len(answer)} candidates {fnv1a:016x}")
