"""Programs that measure the page in Chromium, and its console."""
