"""Poses of a frame of the robot: configurations that reach one, and motions along a straight line. Only a child process loads this room."""
