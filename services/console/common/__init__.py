"""What the console's rooms share: errors and their answers, the guard of requests, queues, reads in turn."""
