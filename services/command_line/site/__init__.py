"""`robomesh up`, and the commands that run one service of a site."""
