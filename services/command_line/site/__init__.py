"""Commands that run: a whole site, one of its services, a bridge, a simulated controller."""
