"""Where the camera is: given by the stream, or found from its images or from lidar scans."""
