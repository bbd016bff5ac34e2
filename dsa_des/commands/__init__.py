"""What the commands of ``dsa-des`` do; each is imported only when it is called."""
