"""Link to one controller: its connection, its health, and the time stamps of its data."""
