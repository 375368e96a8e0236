"""Requests to move or control one robot: received, evaluated by `authority`, audited, executed, answered.

Requests of old client programs come from `legacy`.
"""
