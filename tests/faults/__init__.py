"""What must hold when links, disks, clocks and people fail."""
