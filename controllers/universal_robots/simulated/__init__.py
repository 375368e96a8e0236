"""Simulated Universal Robots controller: RTDE, primary, dashboard, and the scripts that move its arm.

The language of scripts belongs to `script`.
"""
