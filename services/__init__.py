"""What runs at a site: the services, the site file, the supervisor, the command line."""
