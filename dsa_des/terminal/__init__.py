"""The layer between a command and the person at the terminal: printing, and ctrl-C."""
