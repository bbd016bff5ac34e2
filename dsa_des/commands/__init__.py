"""The commands of ``dsa-des``; each is imported only when it is called."""
