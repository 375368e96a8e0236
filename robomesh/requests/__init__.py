"""Requests and their answers: client, server, queues, chunked replies, refusals, times."""
