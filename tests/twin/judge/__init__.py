"""Judges `vgyro replay` independently: simulated drives with known truth, simple rivals, and the
best result of any linear estimator. Shares nothing with the product."""
