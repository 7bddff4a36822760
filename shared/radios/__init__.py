"""Radios that are heard: of a DAP, and of a responder's unit."""
