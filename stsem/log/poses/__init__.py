"""Where the camera was: chains of transforms, odometry, stamped poses; `find.py` chooses, `source.py` looks up."""
