"""What runs at a site: services, site file, supervisor, command line. No service imports another."""
