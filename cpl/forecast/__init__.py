"""What comes next: forecasts of the road and of the robot."""
