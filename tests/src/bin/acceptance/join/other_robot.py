"""Plans as a client that is set up for a robot file, and says how that is answered: other_robot.py ROBOT_FILE."""

import sys

import pcc

answer = pcc.Client(robot_file=sys.argv[1]).plan([1.0, 0.5, 2.3], start=[0.0] * 6)
print(f"{answer.outcome}: {answer.reason}")
