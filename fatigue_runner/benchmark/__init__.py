"""What is proved: the kernel's speed, work-precision of all integrators on the same cases, the speed of the logs."""
