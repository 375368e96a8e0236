"""Drivers of controllers' protocols: received bytes to events, commands to bytes."""
