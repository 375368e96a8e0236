"""Simulated FANUC controller: servers of SNPX, FTP and RMI, and the arm behind them."""
