"""Pose from the images themselves: RGB-D odometry, loop closure, pose graph. Knows no labels."""
