"""Simulated controller with an OPC UA server in the form of OPC 40010-1. It cannot be commanded."""
