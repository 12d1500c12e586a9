"""How fast the program is on this machine: the kernel, the network, the logs, a watched campaign."""
