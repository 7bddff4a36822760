"""How good a mount's path is, against where the boot really was. Pure: arrays in, scores out."""
