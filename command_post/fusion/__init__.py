"""Fusion: strides and proximities of many responders to tracks on one map (pure).

The published system: "Indoor location tracking for first responders using data network" (Korea
Aerospace Research Institute, 2013). A sampling-importance-resampling particle filter for each
responder, tied to deployable access points (DAPs) that stand where their installers were held to
be as they set them down.
"""
