"""Publishers and subscriptions: order, losses, delay, and the last values for late joiners; no requests."""
