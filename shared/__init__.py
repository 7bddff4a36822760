"""What the three programs share: the wire, the bus, time, mathematics and the simulator."""
