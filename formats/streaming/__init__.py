"""Between a log and its frames: which topics, which poses, which scans."""
