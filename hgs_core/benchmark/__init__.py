"""What the machine at hand attains: kernels against its peak, planning and mapping along a mission."""
