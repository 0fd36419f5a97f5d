"""ROS messages: layouts of ROS 1, CDR and JSON, and how each message becomes a noun."""
