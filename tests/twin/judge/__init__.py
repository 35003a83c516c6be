"""Judges `vgyro replay` from outside: simulated drives with known truth, simple rivals, and the best
that any linear estimator can do. Shares nothing with the product."""
