"""A robot whose motors are at once where they are to be: drive.py ROBOT_FILE."""

import sys

import pcc

driver = pcc.Driver(sys.argv[1])
for targets in driver:
    driver.report(targets.position_m)
