"""A deployable access point: hears radios, tells who is near."""
