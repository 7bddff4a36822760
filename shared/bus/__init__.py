"""How messages travel: one interface, in memory for tests and rehearsals, Zenoh in the field."""
