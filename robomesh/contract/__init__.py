"""The agreement of all sites: keys, topics, messages, their header, addresses, rights and quotas.

Nothing is sent or received here.
"""
