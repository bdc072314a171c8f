"""The lab: an experiment is one file, thousands of seeded runs, and one report. Without ROS."""
