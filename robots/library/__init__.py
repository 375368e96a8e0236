"""Library of robots: a folder for each, with its description and shapes. CONTRIBUTING says how to add one."""
