"""Link to one controller: performs a driver's effects, and stamps, checks and counts what it reports.

What bytes mean belongs to the driver.
"""
