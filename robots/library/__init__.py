"""Robots of the library: a folder each with description and shapes, and the generators of these shapes.

CONTRIBUTING says how to add one. No reader: `descriptions` reads them as any other.
"""
