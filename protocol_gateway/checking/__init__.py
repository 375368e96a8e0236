"""Motions checked before they are made: in a worker process of the gateway's own, never over the network."""
