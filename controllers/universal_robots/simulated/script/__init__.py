"""Small interpreter of URScript, the language of Universal Robots' controllers, without I/O."""
