"""How the console listens, and which server of ASGI it runs. No route."""
