"""Requests and their answers: client, server, queues, chunked replies, refusals, latencies.

The handlers are the services'; the rows of the requests are in `contract`.
"""
