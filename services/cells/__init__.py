"""Cells of a site's robots: read from the site file, changed on request, and written back."""
