"""Requests and their answers: pieces, queues, refusals, times."""
