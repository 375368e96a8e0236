"""One robot of a gateway: makes its parts, joins them, and publishes its state.

What a part does belongs to the part's room.
"""
