"""A robot that walks by what it sees: paths, controller, gain rules, predictor, supervisor.

The twin that renders what the robot sees lives in `cpl.quadruped.kinematic`, which needs OpenCV
(the extra `quadruped`); nothing here does.
"""
