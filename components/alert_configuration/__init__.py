"""Configurations of alerting and guidance, and the `.conf` files of DAIDALUS that hold them."""
