"""What is between a command and the person at the terminal: what is shown, and ctrl-C."""
