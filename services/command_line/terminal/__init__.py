"""What commands share: options, output, completion, connections, times for people. No command."""
