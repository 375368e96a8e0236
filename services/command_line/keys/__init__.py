"""Commands for identities: a site's certificates, and the console's accounts with their tokens."""
