"""Motion of a FANUC robot by RMI: messages, and the driver that adds motion to the reading by SNPX."""
