"""rosbag2: folders and .db3 files, by SQLite or from its pages."""
