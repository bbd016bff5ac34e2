"""Who decides about an alert: operators as blocks, and the model of a pilot behind them."""
