"""What each service is: it runs until a signal, has a clock, health and metrics."""
