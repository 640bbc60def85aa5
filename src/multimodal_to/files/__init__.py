"""Files: those of others are read within limits, ours appear whole or not at all."""
