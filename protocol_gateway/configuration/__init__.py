"""Settings of a gateway, the kinds of controllers that they name, and the proofs that they require."""
