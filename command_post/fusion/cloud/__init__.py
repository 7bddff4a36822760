"""One responder's belief as a cloud of particles, where one ellipse cannot tell it: compiled."""
