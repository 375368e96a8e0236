"""What other programs' viewers show: their robots, and Foxglove's layout. No viewer's protocol."""
