"""ROS 2 messages, decoded, as arrays and poses.

Functions take a message as any object with the fields that ROS defines (an MCAP reader's, or one made from
rosbridge's JSON), and `where`, which names file or connection, topic and message in errors.
"""
