"""`hgs ros`: a robot that speaks ROS 2, reached through a rosbridge server; no ROS is needed here."""
