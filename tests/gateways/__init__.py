"""Doors to other systems, with the real thing at the other end where it can be had."""
