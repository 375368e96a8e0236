"""The page's WebSocket: subscriptions down, requests up."""
