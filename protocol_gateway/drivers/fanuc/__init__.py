"""SNPX of FANUC's controllers (memory of a GE PLC over TCP), read only, without I/O."""
