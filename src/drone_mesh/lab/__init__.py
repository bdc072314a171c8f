"""The tester's lab: an experiment is one file, a thousand seeded runs, one report. No ROS."""
