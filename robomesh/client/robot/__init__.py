"""One robot for asynchronous programs: streams of its topics, requests, control with a lease."""
