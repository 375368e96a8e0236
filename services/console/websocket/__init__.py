"""The page's WebSocket: subscriptions down, requests up, and what a slow page gets. No HTTP."""
