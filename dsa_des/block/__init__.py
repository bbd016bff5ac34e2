"""What a block is: its ports, parameters, messages, effects and ladders."""
