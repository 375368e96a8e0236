"""What all sites agree on: keys, topics, messages, their header, addresses and rights. Nothing is sent."""
