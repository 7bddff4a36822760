"""The record, as it was on the wire: its file, its parts, and what can be read of it again."""
