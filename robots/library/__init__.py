"""Library of robots: a folder for each, with its description and meshes. CONTRIBUTING says how to add one."""
